"""Facts about microfacet synthesis as a whole: what one eye saw predicts what others see."""

import dataclasses

import numpy as np
import pytest
from reference.turning import Turning, hemisphere

import gonio as gn
from gonio.brdf.polar_grid import PolarGrid
from gonio.errors import AccuracyWarning
from gonio.fitting.facet_cells import Cells, Joined
from gonio.fitting.microfacets import synthesise_ndfs

GRID = PolarGrid(24, 48)
CLOTH = Turning(16, hemisphere())


def novel_error(fit, truth, theta=60, phi=200):
    """Relative rms of radiance from a place where no eye was, under lights from all over."""
    wi, wo = hemisphere(60, 75.0)[:, None], np.asarray(gn.from_spherical(np.radians(theta), np.radians(phi)))
    found = fit.value.material.f(wi, wo)
    expected = truth.f(wi, np.broadcast_to(wo, (1, 1, 3)), truth.turn)
    return np.sqrt(np.sum(((found - expected) * wi[..., 2:]) ** 2) / np.sum((expected * wi[..., 2:]) ** 2))


@pytest.fixture(scope="module")
def fit():
    return synthesise_ndfs(CLOTH, grid=GRID, representatives=64)


def test_one_view_of_turning_threads_predicts_the_far_side(fit):
    """Of 1 % noise, 64 of 256 turns and 240 lights 8 degrees apart some per cent are left; with the facets of that one
    view alone, half of what the far side shows is missing."""
    assert fit.residual < 0.04
    assert novel_error(fit, CLOTH) < 0.06
    assert fit.converged and "64 distributions" in fit.reason


def test_the_index_and_colours_come_back(fit):
    material = fit.value.material
    assert np.median(material.eta) == pytest.approx(1.45, abs=0.05)
    np.testing.assert_allclose(material.k_d.mean(axis=0), CLOTH.k_d, rtol=0.05)
    # An index .02 too high makes F(60 degrees)/F(1) 5 % too low, which k_s makes up for.
    np.testing.assert_allclose(material.k_s.mean(axis=0), CLOTH.k_s, rtol=0.1)


def test_threads_and_blocks_do_not_change_what_is_found(fit):
    again = synthesise_ndfs(CLOTH, grid=GRID, representatives=64, threads=1).value.material
    for name in ("indices", "weights", "k_d", "k_s", "eta"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fit.value.material, name))


def test_the_papers_growth_is_at_hand():
    paper = synthesise_ndfs(CLOTH, grid=GRID, representatives=64, paper=True)
    assert novel_error(paper, CLOTH) < 0.06 and np.isnan(paper.value.completed.others).all()


def test_threads_that_run_one_way_are_told_of_and_turned_captures_join_as_one():
    """Of a sample seen as it lies and turned by 90, 180 and 270 degrees all sides are known."""
    one_way = dataclasses.replace(CLOTH, side=8, one_way=True)
    with pytest.warns(AccuracyWarning, match="threads run one way.*turned under the camera"):
        synthesise_ndfs(one_way, grid=GRID, representatives=16, eta=1.45)

    class Turned(Turning):
        quarter = 0

        @property
        def turn(self):
            return np.full(len(self), self.quarter * np.pi / 2)

    several = []
    for quarter in range(4):
        several.append(Turned(**dataclasses.asdict(one_way)))
        object.__setattr__(several[-1], "quarter", quarter)
    together = synthesise_ndfs(several, grid=GRID, representatives=32, eta=1.45)
    first = dataclasses.replace(
        together.value.material,
        **{name: getattr(together.value.material, name)[:64] for name in ("indices", "weights", "k_d", "k_s", "eta")},
    )
    joined = dataclasses.replace(together, value=dataclasses.replace(together.value, material=first))
    for phi in (110, 200, 290):
        assert novel_error(joined, one_way, 60, phi) < 0.06


def test_a_run_that_was_stopped_goes_on_from_its_folder(fit, tmp_path):
    class Stop(Exception):
        pass

    near = dataclasses.replace(
        CLOTH, lights=hemisphere(80), eye=1.2 * np.asarray(gn.from_spherical(np.radians(60), 0.4))
    )
    asked = []

    class Counted(Turning):
        def at(self, some):
            asked.append(len(some))
            return Turning.at(self, some)

    counted = Counted(**dataclasses.asdict(near))
    how = {"grid": GRID, "representatives": 16, "eta": 1.45, "tolerance": 0.02, "folder": tmp_path / "work"}

    def stop(step, done, total):
        if done > total // 3:
            raise Stop

    with pytest.raises(Stop):
        synthesise_ndfs(counted, progress=stop, **how)
    asked.clear()
    found = synthesise_ndfs(counted, **how).value.material
    left, _ = sum(asked), asked.clear()
    expected = synthesise_ndfs(counted, **{**how, "folder": None}).value.material
    assert left < sum(asked) - len(counted) // 4
    np.testing.assert_array_equal(found.weights, expected.weights)
    with pytest.raises(gn.GonioError, match=r"partial\.npy is of another sample"):
        synthesise_ndfs(Turning(8, hemisphere()), **how)


def test_near_lights_take_their_own_directions_at_each_site():
    """Lamps .06 above a sample of .1: taken from its middle they would be off by up to 40 degrees."""
    lamps = np.stack((*(a.ravel() for a in np.meshgrid(*2 * [np.linspace(-0.15, 0.15, 14)])), np.full(196, 0.06)), -1)
    near = dataclasses.replace(CLOTH, lights=lamps, near=True)
    cells = Cells.of(Joined((near,)), 0.1)
    assert len(cells.wi) > 30 and sorted(np.concatenate([c.sites for c in cells.cells])) == list(range(256))
    for cell in cells.cells[::7]:
        np.testing.assert_allclose(cell.shares.sum(axis=1), 1, rtol=1e-12)
        between = np.einsum("sk,knd->snd", cell.shares, np.stack([cells.wi[k] for k in cell.nodes]))
        wi, _ = near.directions(near.sites.positions[cell.sites], None)
        # Half vectors differ by .1 from node to node, lights by twice as much, and bend by an eighth of its square.
        assert np.abs(between - wi).max() < 0.2**2 / 4
    fit = synthesise_ndfs(near, grid=GRID, representatives=64, tolerance=0.1, eta=1.45)
    assert novel_error(fit, CLOTH) < 0.12


def test_a_curved_sample_falls_into_cells_of_like_normals():
    flat = CLOTH.sites
    normals = gn.normalise(np.column_stack((8 * flat.positions[:, :2], np.ones(256))))
    frames = np.asarray(gn.frame(normals))

    class Curved(Turning):
        @property
        def sites(self):
            return dataclasses.make_dataclass("Places", ["positions", "frames"])(flat.positions, frames)

        def directions(self, positions, frames):
            wi, wo = super().directions(positions, frames)
            return np.einsum("sij,snj->sni", frames, wi), np.einsum("sij,sj->si", frames, wo)

    cells = Cells.of(Joined((Curved(16, hemisphere()),)), 0.2)
    assert 4 <= len(cells.cells) <= 16
    assert sorted(np.concatenate([c.sites for c in cells.cells])) == list(range(256))
    for cell, wo in zip(cells.cells, cells.wo, strict=True):
        own = np.einsum("sij,j->si", frames[cell.sites], gn.from_spherical(np.radians(60), 0.4))
        assert np.abs(own - wo).max() < 0.4


def test_what_cannot_be_fitted_is_refused():
    for how, message in (
        ({"eta": 0.9}, r"eta = 0.9; an index in \(1, 10\]"),
        ({"representatives": 1000}, "most = 1000: from 1 to 256"),
    ):
        with pytest.raises(gn.GonioError, match=message):
            synthesise_ndfs(CLOTH, grid=GRID, **how)
    with pytest.raises(gn.GonioError, match="2 lights are above the surface"):
        synthesise_ndfs(dataclasses.replace(CLOTH, lights=hemisphere(2)), grid=GRID)
