"""Pixels of photographs: the loop of `files/photographs.py` and `files/store.py`, where NumPy is slow at threes."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def decode(codes, at, table, here, radiance, clipped):  # type: ignore[no-untyped-def]
    """Fill radiance (N, P, 3) and clipped (N, P) at `here` with what `table` says of codes (N, all, 1 or 3) at `at`.

    Clipped is what has the last code in any channel.
    """
    last, blue, end = table.size - 1, codes.shape[2] - 1, codes.shape[1] - 1
    green = blue // 2
    for k in range(codes.shape[0]):
        for i in range(at.size):
            s, p = min(max(at[i], 0), end), here[i]
            r, g, b = codes[k, s, 0], codes[k, s, green], codes[k, s, blue]
            radiance[k, p, 0], radiance[k, p, 1], radiance[k, p, 2] = table[r], table[g], table[b]
            clipped[k, p] = r == last or g == last or b == last
