"""Plain twin of `_kernels/photometric_stereo.py`, by NumPy's least squares."""

import numpy as np


def solve(values, lights, robust, rounds=30, close=1e-3, dark=0.05):
    """g (pixels, 3), which photographs count, rms residual, standard error of the normal; lights (N, 3)."""
    found, counted, residuals, errors = [], [], [], []
    for row in values:
        known = np.isfinite(row)
        I = np.where(known, row, 0)
        g = fit(I, lights, known.astype(float))
        for _ in range(rounds):
            length, expected = np.linalg.norm(g), lights @ g
            seen = known & ((expected > 0) | (dark * length < I))
            weights = seen / np.maximum(np.abs(I - expected), close * length) if robust else seen.astype(float)
            before, g = g, fit(I, lights, weights)
            if np.abs(g - before).sum() <= close * length:
                break
        expected = lights @ g
        count = known & (expected > 0)
        if robust:
            off = np.abs(I - expected)
            count &= off <= max(3 * 1.4826 * np.median(off[count]), 3 * close * np.linalg.norm(g))
        g = fit(I, lights, count.astype(float))
        L = lights[count]
        miss = I[count] - L @ g
        n = g / np.linalg.norm(g)
        covariance = np.linalg.inv(L.T @ L) * np.sum(miss**2) / max(count.sum() - 3, 1)
        across = np.eye(3) - np.outer(n, n)
        found.append(g)
        counted.append(count)
        residuals.append(np.sqrt(np.mean(miss**2)))
        errors.append(np.sqrt(np.trace(across @ covariance)) / np.linalg.norm(g))
    return np.array(found), np.array(counted), np.array(residuals), np.array(errors)


def fit(values, lights, weights):
    root = np.sqrt(weights)
    return np.linalg.lstsq(lights * root[:, None], values * root, rcond=None)[0]
