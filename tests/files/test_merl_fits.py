"""Published fits of the MERL materials."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gonio as gn

ABC = {"kD": [0.3, 0.2, 0.1], "A": [5.0, 6.0, 7.0], "B": 100.0, "C": 1.2, "ior": 1.5}
SGD = {
    "rhoD": [0.3, 0.2, 0.1],
    "rhoS": [0.1, 0.2, 0.3],
    "alpha": [0.2, 0.2, 0.3],
    "p": [0.5, 0.5, 0.6],
    "kap": [5.0, 6.0, 7.0],
    "f0": [0.05, 0.06, 0.07],
    "f1": [0.0, 0.01, -0.01],
    "lambda": [2.0, 3.0, 4.0],
    "c": [0.001, 0.002, 0.003],
    "k": [9.0, 8.0, 7.0],
    "theta0": [0.1, -0.1, 0.2],
    "otherName": "cloth",
}


def written(path, materials):
    path.write_text(json.dumps(materials))
    return path


def test_parameters_become_those_of_the_models(tmp_path):
    fits = gn.read_merl_fits(written(tmp_path / "fits.json", {"pot": ABC, "cloth": SGD}))
    assert_allclose(fits["pot"].a, ABC["A"])
    assert_allclose(fits["pot"].ior, 1.5)
    assert_allclose(fits["cloth"].scale, SGD["kap"])
    assert_allclose(fits["cloth"].theta_0, SGD["theta0"])


@pytest.mark.parametrize(
    ("materials", "message"),
    [
        ({}, "no materials"),
        ([1], "no materials"),
        ({"pot": 3}, "pot is no object"),
        ({"pot": {**ABC, "ior": "x"}}, "pot: ior is no number"),
        ({"pot": {**ABC, "kD": 0.3}}, r"pot: kD has shape \(\)"),
        ({"pot": {**ABC, "C": -1}}, "pot: ABC: c = -1"),
        ({"pot": {**ABC, "B": float("nan")}}, "pot: ABC: b = nan"),
        ({"cloth": {k: v for k, v in SGD.items() if k != "kap"}}, "cloth has no kap"),
    ],
)
def test_files_that_hold_no_fits_are_refused_by_name(tmp_path, materials, message):
    with pytest.raises(gn.GonioError, match=message):
        gn.read_merl_fits(written(tmp_path / "fits.json", materials))


def test_files_too_large_to_be_fits_are_not_read(tmp_path):
    with (tmp_path / "fits.json").open("wb") as file:
        file.truncate(2**24 + 1)
    with pytest.raises(gn.GonioError, match="more than 16777216 bytes"):
        gn.read_merl_fits(tmp_path / "fits.json")


def test_what_is_no_json_is_refused(tmp_path):
    (tmp_path / "fits.json").write_text("{")
    with pytest.raises(gn.GonioError, match="no JSON"):
        gn.read_merl_fits(tmp_path / "fits.json")
    with pytest.raises(gn.GonioError, match="cannot be read"):
        gn.read_merl_fits(tmp_path / "absent.json")


def test_two_fits_of_one_material_agree_where_both_were_fitted(data):
    """ABC and SGD were fitted to the same measurements by others: median over 100 materials, in green."""
    abc, sgd = (gn.read_merl_fits(data / "brdf/merl-fits" / f"{name}_params.json") for name in ("abc", "sgd"))
    assert abc.keys() == sgd.keys()
    assert len(abc) == 100
    rng = np.random.default_rng(1)
    z, phi = rng.uniform(0.4, 1, (2, 400)), rng.uniform(0, 2 * np.pi, (2, 400))
    s = np.sqrt(1 - z * z)
    wi, wo = np.stack((s * np.cos(phi), s * np.sin(phi), z), axis=-1)
    off = []
    for name, model in abc.items():
        one, other = model.f(wi, wo), sgd[name].f(wi, wo)
        assert np.isfinite(one).all()
        assert np.isfinite(other).all()
        assert one.min() >= 0
        assert other.min() >= 0
        off.append(np.median(np.abs(np.log(one[:, 1] / other[:, 1]))))
    # Highlights differ by up to twice, most of the hemisphere by a tenth or two.
    assert np.median(off) < 0.25
