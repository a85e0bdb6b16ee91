"""The sRGB curve and luminance."""

import numpy as np
import pytest

from gonio.colour import luminance, srgb_decode, srgb_encode


def test_srgb_takes_its_closed_form_values():
    # IEC 61966-2-1: the ends, the knee from below, and middle grey worked out by hand.
    encoded = np.array([0.0, 0.04045, 0.5, 1.0])
    linear = np.array([0.0, 0.04045 / 12.92, (0.555 / 1.055) ** 2.4, 1.0])
    np.testing.assert_allclose(srgb_decode(encoded), linear, rtol=1e-15)
    # The standard rounds the two knees apart, .0031308 for .04045 / 12.92 = .00313080495.
    np.testing.assert_allclose(srgb_encode(linear), encoded, atol=1e-6)


def test_encoding_undoes_decoding():
    codes = np.arange(65536) / 65535
    # The rounded knee of the standard costs up to 3e-8; a code of 16 bits is 1.5e-5.
    np.testing.assert_allclose(srgb_encode(srgb_decode(codes)), codes, atol=1e-7)


def test_the_line_near_black_goes_on_below_it():
    np.testing.assert_allclose(srgb_decode(-0.1292), -0.01, rtol=1e-15)
    np.testing.assert_allclose(srgb_encode(-0.01), -0.1292, rtol=1e-15)


def test_white_has_unit_luminance_and_green_most_of_it():
    assert luminance(np.ones(3)) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(luminance(np.eye(3)), [0.2126, 0.7152, 0.0722], rtol=1e-15)


def test_pytorch_gets_the_same_values_dtype_and_finite_gradients():
    torch = pytest.importorskip("torch")
    x = torch.tensor([-0.5, 0.0, 0.001, 0.5, 1.0], dtype=torch.float32, requires_grad=True)
    for curve in (srgb_encode, srgb_decode):
        y = curve(x)
        assert y.dtype == torch.float32
        np.testing.assert_allclose(y.detach().numpy(), curve(x.detach().numpy().astype(float)), rtol=1e-5, atol=1e-6)
        (gradient,) = torch.autograd.grad(y.sum(), x)
        assert bool(torch.isfinite(gradient).all())
