"""The sRGB curve, luminance, and spectra against Mitsuba's tables of the CIE."""

import numpy as np
import pytest

from gonio.colour import colour_matching, illuminant_d65, luminance, spectrum_to_rgb, srgb_decode, srgb_encode
from gonio.errors import ArrayError

VISIBLE = np.arange(400.0, 701.0, 10.0)


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


def test_matching_functions_are_the_observers_within_two_and_a_half_percent_of_their_peaks():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    l = np.arange(380.0, 781.0, 5.0)
    table = np.array([np.ravel(mi.cie1931_xyz(float(k))) for k in l])
    # Wyman et al. report largest errors of that order for the multi-lobe fit.
    assert np.all(np.abs(colour_matching(l) - table).max(axis=0) < 0.025 * table.max(axis=0))


def test_d65_is_mitsubas():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_spectral")
    spectrum = mi.load_dict({"type": "d65"})
    si = mi.SurfaceInteraction3f()
    l = np.arange(360.0, 781.0, 10.0)
    theirs = []
    for k in l:
        si.wavelengths = [float(k)] * 4
        theirs.append(float(spectrum.eval(si)[0]))
    ratio = np.array(theirs) / illuminant_d65(l)
    # Theirs is scaled to a luminance of 1; only the ratio between wavelengths is compared. Single precision.
    assert np.allclose(ratio, ratio[20], rtol=1e-5)


@pytest.mark.parametrize(
    "wavelengths", [VISIBLE, np.linspace(360, 1000, 195), np.array([400.0, 410, 450, 500, 600, 690])]
)
def test_a_flat_spectrum_is_gray_whatever_the_wavelengths(wavelengths):
    assert np.allclose(spectrum_to_rgb(wavelengths, np.full(len(wavelengths), 0.4)), 0.4, rtol=1e-12)


def test_colours_agree_with_the_tabulated_observer():
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    cmf = np.array([np.ravel(mi.cie1931_xyz(float(k))) for k in VISIBLE]) * illuminant_d65(VISIBLE)[:, None]
    smooth = np.stack([0.5 + 0.4 * np.sin(VISIBLE / 60 + p) for p in (0.0, 1.0, 2.0, 3.0)])
    matrix = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    theirs = (smooth @ cmf @ matrix.T) / (cmf.sum(axis=0) @ matrix.T)
    # The fit of the observer is good to 1-2 % of its peaks; smooth reflectance feels less than that.
    assert np.abs(spectrum_to_rgb(VISIBLE, smooth) - theirs).max() < 0.015


def test_a_narrow_band_has_the_colour_of_its_wavelength():
    for peak, channel in ((450.0, 2), (540.0, 1), (630.0, 0)):
        assert np.argmax(spectrum_to_rgb(VISIBLE, np.exp(-(((VISIBLE - peak) / 15) ** 2)))) == channel


def test_spectra_held_in_tensors_become_tensors():
    torch = pytest.importorskip("torch")
    rgb = spectrum_to_rgb(VISIBLE, torch.ones(2, 31))
    assert rgb.dtype == torch.float32
    assert np.allclose(rgb.numpy(), 1, atol=1e-5)


@pytest.mark.parametrize(
    ("wavelengths", "samples", "message"),
    [
        (VISIBLE[::-1], np.ones(31), "rising"),
        (VISIBLE * 1e-9, np.ones(31), "nanometres"),
        (VISIBLE, np.ones(30), "31 wavelengths"),
        (np.where(VISIBLE == 500, np.nan, VISIBLE), np.ones(31), "nan"),
    ],
)
def test_spectra_that_make_no_sense_are_refused(wavelengths, samples, message):
    with pytest.raises(ArrayError, match=message):
        spectrum_to_rgb(wavelengths, samples)


def test_luminance_of_four_components_is_refused():
    with pytest.raises(ArrayError, match="components last"):
        luminance(np.ones((3, 4)))
