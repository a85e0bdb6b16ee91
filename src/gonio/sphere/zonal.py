"""Kernels that depend on the angle to an axis alone, by one number a degree; convolution with them is a product.

    k(w . axis) = sum over l of (2l+1) / (4 pi) A_l P_l(w . axis),    A_l = 2 pi integral of k(u) P_l(u) du, -1 to 1
    B_lm = A_l L_lm                                                                                      (RH 2.62)

A_l is RH's Lambda_l rho_l, Lambda_l = sqrt(4 pi / (2l+1)): A_0 is the kernel's integral over the sphere.
Radially symmetric BRDFs are such kernels about the normal (Lambert) or the mirror direction (RH 2.60, chapter 3);
blurring a light by a kernel and reflecting it in a mirror is the same as reflecting it in that BRDF (RH 3.41).

Arrays: (degree+1,) or (degree+1, C), one kernel for each channel. BRDFs of full dimension stand in `convolution.py`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np

from ..arrays import Array, floats, is_numpy, like, namespace, to_numpy
from ..errors import AccuracyWarning, ArrayError, ParameterError
from .harmonics import degree_of, degrees_and_orders, require_degree

_MOST_PANELS = 4096


def convolve(coefficients: Array, kernel: Array) -> Array:
    """A_l f_lm: `coefficients` ((degree+1)^2, ...), real or complex, `kernel` (degree+1,) or (degree+1, C). RH 2.62.

    A kernel of higher degree is cut; raises `ArrayError` where it is of lower degree.
    """
    degree = degree_of(coefficients)
    if kernel.ndim not in (1, 2) or kernel.shape[0] <= degree:
        raise ArrayError(
            f"kernel has shape {tuple(kernel.shape)}; it needs (degree+1,) or (degree+1, C), degree {degree}."
        )
    if coefficients.ndim == 1 and kernel.ndim == 2:
        coefficients = coefficients[:, None]
    if is_numpy(kernel):
        kernel = like(kernel, coefficients)
    xp = namespace(coefficients, kernel)
    l = xp.asarray(degrees_and_orders(degree)[0], device=kernel.device)
    factor = xp.take(kernel, l, axis=0)
    return coefficients * (factor if factor.ndim == coefficients.ndim else factor[:, None])


def values(kernel: Array, cosine: Array) -> Array:
    """k(cosine): `kernel` (degree+1,) -> (...), (degree+1, C) -> (..., C), for cosines (...) in [-1, 1].

    Summed by Clenshaw's recurrence, which is stable for every degree.
    """
    xp, kernel, cosine = floats(kernel, cosine)
    if kernel.ndim not in (1, 2) or kernel.shape[0] == 0:
        raise ArrayError(f"kernel has shape {tuple(kernel.shape)}; it is (degree+1,) or (degree+1, C).")
    u = cosine if kernel.ndim == 1 else cosine[..., None]
    one = two = xp.zeros_like(u) + xp.zeros_like(kernel[0, ...])
    for l in range(kernel.shape[0] - 1, -1, -1):
        weighted = kernel[l, ...] * ((2 * l + 1) / (4 * math.pi))
        one, two = weighted + (2 * l + 1) / (l + 1) * u * one - (l + 1) / (l + 2) * two, one
    return one


def coefficients(degree: int, lobe: Callable[[np.ndarray], np.ndarray], extent: float = math.pi) -> np.ndarray:
    """A_l to `degree`, (degree+1,) or (degree+1, C), of k = lobe(theta): (N,) radians -> (N,) or (N, C), by quadrature.

    `lobe` is taken to vanish beyond `extent`. Gauss-Legendre on equal panels, halved until A agrees to 1e-10 of the
    largest; a kink or step is best at a half, quarter, ... of the extent (the horizon of [0, pi] is). Raises
    `ParameterError` for a bad degree or extent, `ArrayError` where the lobe is not finite, and warns
    `AccuracyWarning` where 4,096 panels do not suffice.
    """
    require_degree(degree)
    if not 0 < extent <= math.pi:
        raise ParameterError(f"extent = {extent} is not in (0, pi].")
    nodes, weights = np.polynomial.legendre.leggauss(32)
    panels, before = 2 * (1 + degree // 32), None
    while True:
        width = extent / panels
        theta = (width * (np.arange(panels)[:, None] + (nodes + 1) / 2)).reshape(-1)
        measure = np.tile(weights, panels) * (math.pi * width) * np.sin(theta)
        A = _project(degree, np.cos(theta), np.asarray(lobe(theta), dtype=np.float64), measure)
        if before is not None and np.all(np.abs(A - before) <= 1e-10 * np.max(np.abs(A))):
            return A
        if panels >= _MOST_PANELS:
            change = np.max(np.abs(A - before)) / np.max(np.abs(A)) if before is not None else math.inf
            warnings.warn(
                f"the kernel's A_l still change by {change:.1e} of the largest at {panels} panels; "
                "its lobe has a step or a peak where no panel ends: choose `extent` there.",
                AccuracyWarning,
                stacklevel=2,
            )
            return A
        panels, before = 2 * panels, A


def mirror(degree: int) -> np.ndarray:
    """A_l = 1: light as it is. RH 3.27."""
    require_degree(degree)
    return np.ones(degree + 1)


def clamped_cosine(degree: int) -> np.ndarray:
    """A_l of max(cos theta, 0), the irradiance of a plane: pi, 2 pi/3, pi/4, 0, -pi/24, 0, pi/64, ... RH 3.32, mended.

    Divide by pi for a Lambertian surface of albedo 1.
    """
    require_degree(degree)
    A = np.zeros(max(degree + 1, 3))
    A[:3] = math.pi, 2 * math.pi / 3, math.pi / 4
    # 2 pi (-1)^(l/2-1) / ((l+2)(l-1)) l! / (2^l (l/2)!^2), from each even l to the next: nothing overflows.
    for l in range(4, degree + 1, 2):
        A[l] = -A[l - 2] * (l - 3) / (l + 2)
    return A[: degree + 1]


def phong(degree: int, exponent: Array) -> Array:
    """A_l of (s + 1) / (2 pi) max(cos theta, 0)^s, unit energy; any real s >= 0, number or (C,). RH 3.37.

    A_l = A_(l-2) (s - l + 2) / (s + l + 1), A_0 = 1, A_1 = (s + 1) / (s + 2).
    """
    require_degree(degree)
    xp, s = floats(exponent)
    if not bool(xp.all(s >= 0)):
        raise ParameterError(f"phong: exponent = {float(xp.min(s)):.6g} is negative.")
    A = [xp.ones_like(s), (s + 1) / (s + 2)]
    for l in range(2, degree + 1):
        A.append(A[l - 2] * ((s - l + 2) / (s + l + 1)))
    return xp.stack(A[: degree + 1], axis=0)


def phong_small_degree(degree: int, exponent: Array) -> Array:
    """exp(-l^2 (1/(2s) + 1/(2s^2))): RH 3.39, mended, the series for l far below s of RH 3.38's gamma functions.

    It shows the width sqrt(s); `phong_gaussian` is the better number.
    """
    xp, s, l = _against_degrees(degree, exponent)
    return xp.exp(-l * l * (1 / (2 * s) + 1 / (2 * s * s)))


def phong_gaussian(degree: int, exponent: Array) -> Array:
    """exp(-l (l+1) / (2 (s+1))): .0031 off `phong` at s = 32, where exp(-l^2 / 2s) is .04 off. RH 3.40, mended."""
    xp, s, l = _against_degrees(degree, exponent)
    return xp.exp(-l * (l + 1) / (2 * (s + 1)))


def gaussian(degree: int, width: Array) -> Array:
    """exp(-width^2 l (l+1)): the heat kernel of unit energy; it blurs as exp(-theta^2 / (4 width^2)) where narrow.

    width in radians, number or (C,). Two of them in a row are one with width^2 added. RH 3.51 without its A_0.
    """
    xp, width, l = _against_degrees(degree, width)
    return xp.exp(-width * width * l * (l + 1))


def microfacet(degree: int, sigma: float, cos_theta_o: float = 1.0) -> np.ndarray:
    """A_l of RH's microfacet lobe exp(-(theta_h / sigma)^2) / (4 pi sigma^2 cos theta_o) about the mirror direction.

    A_0 exp(-X (1 + c^2) / 2) I_0(X (1 - c^2) / 2), X = sigma^2 l (l+1), c = cos_theta_o (RH 3.53, mended): the lobe is
    2 sigma wide in the plane of incidence and 2 sigma c across, and this is its mean over azimuth, within .21 sigma^2
    at every l for theta_o <= 60 degrees: 5e-4 at sigma = .05, .008 at .2. The lobe is taken whole: where the horizon
    cuts it, its energy falls short of A_0, by .015 at sigma = .2 and 60 degrees. A_0 is the same for every theta_o
    (RH 3.44). At normal exitance this is RH 3.51 with l (l+1).
    Raises `ParameterError` where sigma is not in (0, 1] or c not in (0, 1].
    """
    require_degree(degree)
    if not 0 < sigma <= 1 or not 0 < cos_theta_o <= 1:
        raise ParameterError(f"microfacet: sigma = {sigma:.6g} and cos_theta_o = {cos_theta_o:.6g} lie in (0, 1].")
    from scipy.special import ive

    l = np.arange(degree + 1)
    X, c2 = sigma**2 * l * (l + 1.0), cos_theta_o**2
    # ive(0, x) = exp(-x) I_0(x): its exponential joins the first, and neither overflows.
    shape: np.ndarray = np.exp(-X * c2) * ive(0, X * (1 - c2) / 2)
    energy = float(microfacet_at_normal(0, sigma)[0])
    return energy * shape


def microfacet_at_normal(degree: int, sigma: float) -> np.ndarray:
    """A_l of exp(-theta^2 / (4 sigma^2)) / (4 pi sigma^2), theta < pi/2: the microfacet lobe at normal exitance.

    RH 3.44 by quadrature, to 1e-10: what RH 3.51 approximates.
    """

    def lobe(theta: np.ndarray) -> np.ndarray:
        value: np.ndarray = np.exp(-(theta**2) / (4 * sigma**2)) / (4 * math.pi * sigma**2)
        return value

    return coefficients(degree, lobe, min(math.pi / 2, 16 * sigma))  # exp(-64) beyond


def _project(degree: int, u: np.ndarray, lobe: np.ndarray, measure: np.ndarray) -> np.ndarray:
    """Sums of measure * lobe * P_l(u), l = 0..degree."""
    if lobe.shape[:1] != u.shape or lobe.ndim > 2 or not np.all(np.isfinite(lobe)):
        raise ArrayError(f"the lobe gave shape {lobe.shape} for {u.shape} angles, or values that are not finite.")
    weighted = (measure * lobe.T).T
    before, P = np.zeros_like(u), np.ones_like(u)
    A = np.empty((degree + 1, *lobe.shape[1:]))
    for l in range(degree + 1):
        A[l] = P @ weighted
        before, P = P, ((2 * l + 1) * u * P - l * before) / (l + 1)
    return A


def _against_degrees(degree: int, parameter: Array) -> tuple[Array, Array, Array]:
    """Namespace, the positive parameter () or (C,), and l = 0..degree shaped to meet it."""
    require_degree(degree)
    xp, parameter = floats(parameter)
    if not bool(xp.all(parameter > 0)):
        raise ParameterError(f"width or exponent = {float(to_numpy(parameter).min()):.6g} is not positive.")
    l = like(np.arange(degree + 1.0), parameter)
    return xp, parameter, l.reshape((-1,) + (1,) * parameter.ndim)
