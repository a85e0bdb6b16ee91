"""Colour: spectra to linear RGB, luminance, and the sRGB curve.

    X = sum of r(l) S(l) xbar(l) dl,   likewise Y and Z;   RGB = M XYZ,  each channel divided by that of r = 1

r is reflectance, S the CIE standard illuminant D65, M the matrix of IEC 61966-2-1 (primaries of BT.709). The colour
matching functions are the multi-lobe fit of Wyman, Sloan and Shirley 2013 to the CIE 1931 2-degree observer, within
1 % of their peaks. The division makes a surface that reflects alike at all wavelengths gray, whatever the samples.
Not here: chromatic adaptation, other observers, and colour spaces other than linear sRGB.
"""

from __future__ import annotations

import numpy as np

from .arrays import Array, floats, like, require_finite
from .errors import ArrayError

# CIE standard illuminant D65, 360 to 780 nm by 10 nm (CIE 15:2004, table T.1), 100 at 560 nm.
_D65_FIRST, _D65_STEP = 360.0, 10.0
# fmt: off
_D65 = np.array([
    46.6383, 52.0891, 49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812,
    114.861, 115.923, 108.811, 109.354, 107.802, 104.790, 107.689, 104.405, 104.046, 100.000, 96.3342,
    95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778, 78.2842,
    69.7213, 71.6091, 74.3490, 61.6040, 69.8856, 75.0870, 63.5927, 46.4182, 66.8054, 63.3828,
])
# fmt: on
_RGB_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def colour_matching(wavelengths: Array) -> np.ndarray:
    """xbar, ybar, zbar of the CIE 1931 2-degree observer at `wavelengths` (nm): (...) -> (..., 3).

    Wyman, Sloan and Shirley 2013, equation 4 ("Simple Analytic Approximations to the CIE XYZ Color Matching
    Functions", the multi-lobe fit).
    """
    l = np.asarray(wavelengths, np.float64)

    def lobe(peak: float, below: float, above: float) -> np.ndarray:
        value: np.ndarray = np.exp(-0.5 * ((l - peak) / np.where(l < peak, below, above)) ** 2)
        return value

    x = 1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2)
    y = 0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1)
    z = 1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)
    return np.stack((x, y, z), axis=-1)


def illuminant_d65(wavelengths: Array) -> np.ndarray:
    """Relative power of D65 at `wavelengths` (nm), linear between the CIE's samples, held beyond 360-780 nm."""
    power: np.ndarray = np.interp(wavelengths, _D65_FIRST + _D65_STEP * np.arange(len(_D65)), _D65)
    return power


def spectrum_to_rgb(wavelengths: Array, reflectance: Array) -> Array:
    """Linear sRGB (..., 3) of spectral reflectance (..., n) sampled at `wavelengths` (n,), nm, rising, under D65.

    Sums by the trapezoid rule; samples outside 360-780 nm count for next to nothing. Saturated spectra lie outside
    sRGB and have negative components: they are returned as they are. r = 1 gives exactly (1, 1, 1).

    Raises `ArrayError` where the wavelengths do not rise, fewer than two fall on the visible range 400-700 nm,
    or their number is not that of the samples.
    """
    l = np.asarray(wavelengths, np.float64)
    require_finite(l, "wavelengths")
    if l.ndim != 1 or len(l) < 2 or not bool(np.all(np.diff(l) > 0)):
        raise ArrayError(f"wavelengths must be two or more rising numbers in nm, got shape {l.shape}.")
    if np.count_nonzero((l >= 400) & (l <= 700)) < 2:
        raise ArrayError(
            f"wavelengths run from {l[0]:g} to {l[-1]:g}, with fewer than two in 400-700. Give them in nanometres."
        )
    _, reflectance = floats(reflectance)
    if reflectance.ndim == 0 or reflectance.shape[-1] != len(l):
        raise ArrayError(
            f"reflectance has shape {tuple(reflectance.shape)}; its last axis must hold the {len(l)} wavelengths."
        )
    steps = np.diff(l)
    width = 0.5 * (np.append(steps, 0) + np.insert(steps, 0, 0))
    weights = (colour_matching(l) * (illuminant_d65(l) * width)[:, None]) @ _RGB_FROM_XYZ.T
    return reflectance @ like(weights / weights.sum(axis=0), reflectance)


def luminance(rgb: Array) -> Array:
    """Relative luminance 0.2126 R + 0.7152 G + 0.0722 B (BT.709) of linear RGB: (..., 3) -> (...)."""
    _, rgb = floats(rgb)
    if rgb.ndim == 0 or rgb.shape[-1] != 3:
        raise ArrayError(f"rgb has shape {tuple(rgb.shape)}; colours are (..., 3), components last.")
    return 0.2126 * rgb[..., 0] + 0.7152 * rgb[..., 1] + 0.0722 * rgb[..., 2]


def srgb_encode(linear: Array) -> Array:
    """The sRGB curve of IEC 61966-2-1: linear values to display values, both 0 to 1; the curve goes on beyond 1.

    Negative values stay on the straight piece (12.92 x).
    """
    xp, linear = floats(linear)
    curved = xp.maximum(linear, xp.full_like(linear, 0.0031308))
    return xp.where(linear <= 0.0031308, 12.92 * linear, 1.055 * curved ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: Array) -> Array:
    """Display values to linear values, both 0 to 1: the inverse of `srgb_encode`."""
    xp, encoded = floats(encoded)
    curved = xp.maximum(encoded, xp.full_like(encoded, 0.04045))
    return xp.where(encoded <= 0.04045, encoded / 12.92, ((curved + 0.055) / 1.055) ** 2.4)
