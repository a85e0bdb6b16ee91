"""The sum over degrees that couples light and BRDF to what is reflected: the loop of `sphere/reflected.py`.

out[s, j] = sum over i of weight[i, s, j] kappa[kappa_at[i, s, j]] light[light_at[i, s, j]]
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"}, error_model="numpy")
def couple(light, kappa, light_at, kappa_at, weight, out):  # type: ignore[no-untyped-def]
    """Fill `out` (sets, places, C), complex, from light (N, C), complex, and kappa (K, C), real; either C may be 1."""
    channels = out.shape[2]
    for s in range(out.shape[0]):
        for j in range(out.shape[1]):
            for c in range(channels):
                out[s, j, c] = 0
            for i in range(weight.shape[0]):
                w = weight[i, s, j]
                if w != 0:
                    a, b = light[light_at[i, s, j]], kappa[kappa_at[i, s, j]]
                    for c in range(channels):
                        out[s, j, c] += w * b[c if b.size > 1 else 0] * a[c if a.size > 1 else 0]
