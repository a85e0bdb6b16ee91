"""Pixels of photographs: the loops of `capture/photographs.py` and `files/store.py`, where NumPy is slow at threes."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def pick(radiance, clipped, at, picked, marked):  # type: ignore[no-untyped-def]
    """Fill `picked` (P, 3) from radiance (all, 3) and `marked` (P,) from clipped (all,) at pixels `at` (P,)."""
    last = radiance.shape[0] - 1
    for i in range(at.size):
        p = min(max(at[i], 0), last)
        picked[i, 0], picked[i, 1], picked[i, 2] = radiance[p, 0], radiance[p, 1], radiance[p, 2]
        marked[i] = clipped[p]


@njit(cache=True, nogil=True, error_model="numpy")
def decode(codes, at, table, here, radiance, clipped):  # type: ignore[no-untyped-def]
    """Fill radiance (N, P, 3) and clipped (N, P) at `here` with what `table` says of codes (N, all, 3) at `at`.

    Clipped is what has the last code in any channel.
    """
    last = table.size - 1
    for k in range(codes.shape[0]):
        for i in range(at.size):
            red, green, blue = codes[k, at[i], 0], codes[k, at[i], 1], codes[k, at[i], 2]
            p = here[i]
            radiance[k, p, 0], radiance[k, p, 1], radiance[k, p, 2] = table[red], table[green], table[blue]
            clipped[k, p] = red == last or green == last or blue == last
