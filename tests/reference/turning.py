"""A flat sample of one anisotropic cloth whose threads turn from site to site, as one eye sees it under many lights."""

import dataclasses
import types

import numpy as np

import gonio as gn


@dataclasses.dataclass(frozen=True, eq=False)
class Turning:
    """`side` x `side` sites on a square of .1, seen by an eye 60 degrees aside, far away or at `eye`, under `lights`
    (N, 3), directions or, if `near`, places. What `fitting` measures."""

    side: int = 16
    lights: np.ndarray = None
    near: bool = False
    eye: np.ndarray = None
    eta: float = 1.45
    k_d: tuple = (0.3, 0.2, 0.1)
    k_s: tuple = (0.05, 0.06, 0.07)
    one_way: bool = False

    def __len__(self):
        return self.side**2

    @property
    def turn(self):
        """(S,): of the threads."""
        if self.one_way:
            return np.zeros(len(self))
        return np.random.default_rng(1).uniform(0, 2 * np.pi, len(self))

    @property
    def sites(self):
        x, y = np.meshgrid(*2 * [(np.arange(self.side) + 0.5) / self.side * 0.1 - 0.05])
        positions = np.stack((x.ravel(), y.ravel(), 0 * x.ravel()), axis=-1)
        return types.SimpleNamespace(positions=positions, frames=np.broadcast_to(np.eye(3), (len(self), 3, 3)))

    def directions(self, positions, frames):
        to = self.lights[None] - positions[:, None] if self.near else np.broadcast_to(
            self.lights, (len(positions), *self.lights.shape)
        )  # fmt: skip
        eye = gn.from_spherical(np.radians(60), 0.4)
        wo = np.broadcast_to(eye, positions.shape) if self.eye is None else gn.normalise(self.eye - positions)
        return gn.normalise(to), wo

    def f(self, wi, wo, turn):
        """(..., 3), by gonio's closed forms in a frame turned about the normal."""
        c, s = np.cos(turn), np.sin(turn)
        wi, wo = (np.broadcast_to(w, (*np.broadcast_shapes(w.shape[:-1], turn.shape), 3)) for w in (wi, wo))
        local = [
            np.stack((c * w[..., 0] + s * w[..., 1], c * w[..., 1] - s * w[..., 0], w[..., 2]), -1) for w in (wi, wo)
        ]
        facets = gn.Microfacet(gn.Beckmann(0.45, 0.2), gn.Fresnel(self.eta), gn.Ashikhmin())
        shine = facets.f(*local) / ((self.eta - 1) / (self.eta + 1)) ** 2
        return np.array(self.k_d) / np.pi + shine * self.k_s

    def at(self, some):
        wi, wo = self.directions(self.sites.positions[some], None)
        value = self.f(wi, np.broadcast_to(wo[:, None], wi.shape), self.turn[some][:, None])
        noise = np.stack([np.random.default_rng([7, site]).standard_normal(wi.shape[1:]) for site in some])
        value = np.where(wi[..., 2:] > 0, value * (1 + 0.01 * noise), np.nan)
        return types.SimpleNamespace(
            wi=wi.astype(np.float32), wo=wo, value=value.astype(np.float32), weight=np.maximum(wi[..., 2], 0) ** 2
        )


def hemisphere(count=240, steepest=85.0):
    """Directions (count, 3), evenly spread by the golden angle."""
    k = np.arange(count) + 0.5
    z = 1 - k / count * (1 - np.cos(np.radians(steepest)))
    return np.asarray(gn.from_spherical(np.arccos(z), np.pi * (3 - 5**0.5) * k))
