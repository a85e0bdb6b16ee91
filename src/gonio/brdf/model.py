"""What every BRDF is: a value with f(wi, wo), and what follows from it for all models alike.

    B(wo) = integral of f(wi, wo) L(wi) cos theta_i d omega_i

f is the BRDF in 1/sr, without cosine (Lambert is albedo/pi); wi to the light, wo to the eye, both unit, both in the
local frame (s, t, n) with n = (0, 0, 1). f is zero where either lies below the surface.

Shapes: directions (..., 3); f is (..., C) with C = 1 (gray) or 3 (RGB), components last always, so that gray and
coloured terms, lights and albedos multiply without asking. Colour parameters are a number or (..., C); other
parameters are a number or (...), broadcast against the directions' leading axes: one value for each site.

A model is frozen and checked when made; `dataclasses.replace(ggx, alpha=0.1)` makes another. Models add
(`Lambert(0.5) + Phong(...)`) and scale (`0.3 * Phong(...)`); see `combine.py`.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from ..arrays import Array, floats, frozen, is_numpy, like, namespace, require_broadcast, to_numpy
from ..directions import cos_theta, require_unit
from ..errors import ParameterError


@dataclasses.dataclass(frozen=True)
class Bounds:
    """The closed range of a parameter, and whether it is a colour: what `BRDF.bounds` holds for each name.

    `own` is how many axes beside a colour's belong to the parameter itself; the axes before them are sites'. `dtype`
    is what it is held in.
    """

    low: float
    high: float
    colour: bool = False
    own: int = 0
    dtype: type = np.float64

    def axes(self, value: Array) -> int:
        """How many leading axes of `value` are sites'."""
        return max(int(value.ndim) - self.own - self.colour, 0)


class Parametric:
    """A frozen dataclass whose array fields named in `bounds` are checked, copied and made read-only when made."""

    bounds: ClassVar[dict[str, Bounds]] = {}

    def __post_init__(self) -> None:
        for name, bound in self.bounds.items():
            if getattr(self, name) is None:  # a parameter that may be left out
                continue
            try:
                value = frozen(getattr(self, name), bound.dtype)
            except (TypeError, ValueError) as error:
                raise ParameterError(f"{type(self).__name__}: {name} is not a number or an array of them.") from error
            xp = namespace(value)
            if not bool(xp.all((value >= bound.low) & (value <= bound.high))):  # so written that NaN fails too
                values = to_numpy(value).ravel()
                worst = values[~((values >= bound.low) & (values <= bound.high))][0]
                raise ParameterError(
                    f"{type(self).__name__}: {name} = {worst:.6g} lies outside [{bound.low:g}, {bound.high:g}]."
                )
            if bound.colour and value.ndim > 0 and value.shape[-1] not in (1, 3):
                raise ParameterError(
                    f"{type(self).__name__}: {name} has shape {tuple(value.shape)}; "
                    "a colour is a number or (..., 1) or (..., 3)."
                )
            object.__setattr__(self, name, value)

    def at(self, uv: Array | None, width: Array | None = None) -> Any:
        """This at N sites with texture coordinates `uv` (N, 2), where parameters cannot be looked up one by one.

        `width` (N,) is the root of each one's footprint's area in (u, v).
        """
        return None

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """The names of the parameters that have bounds, in their order."""
        return tuple(cls.bounds)


class BRDF(Parametric, ABC):
    """A reflectance model in the local frame. Subclasses say `_f`; everything else follows, or is made sharper."""

    def f(self, wi: Array, wo: Array) -> Array:
        """The BRDF in 1/sr: unit local directions (..., 3), (..., 3), broadcast -> (..., C).

        Zero below the surface. Raises `DirectionError` for directions that are not unit, `ArrayError` for shapes
        that are not (..., 3) or do not broadcast.
        """
        require_unit(wi, "wi")
        require_unit(wo, "wo")
        xp, wi, wo = floats(wi, wo)
        require_broadcast(wi=wi, wo=wo)
        return self.evaluate(xp, wi, wo)

    def evaluate(self, xp: Any, wi: Array, wo: Array) -> Array:
        """`f` without its checks, for callers that made the directions themselves; `xp, wi, wo` come from `floats`."""
        if is_numpy(wi, wo) and (values := self._compiled(wi, wo)) is not None:
            return values
        above = (cos_theta(wi) > 0) & (cos_theta(wo) > 0)
        return xp.where(above[..., None], self._f(xp, wi, wo), xp.zeros_like(wi[..., :1]))

    @abstractmethod
    def _f(self, xp: Any, wi: Array, wo: Array) -> Array:
        """The model's formula; finite for every pair of directions, whatever it returns below the surface."""

    def _compiled(self, wi: Array, wo: Array) -> Array | None:
        """What `evaluate` answers for NumPy arrays, by a compiled loop; None where the model has none."""
        return None

    def sample(self, wo: Array, u: Array) -> Array:
        """Directions `wi` (..., 3) drawn for `wo` (..., 3) by uniform numbers `u` (..., 3) in [0, 1).

        u[..., 0] chooses among lobes, the others the direction. The density is `pdf`; wi may fall below the surface,
        where f is zero. The default draws by the cosine, which suits every model and flatters none.
        """
        from .sampling import cosine_direction

        xp, wo, u = floats(wo, u)
        return cosine_direction(u[..., 1:]) + xp.zeros_like(wo)

    def pdf(self, wi: Array, wo: Array) -> Array:
        """The density of `sample` in 1/sr: (..., 3), (..., 3) -> (...)."""
        xp, wi, wo = floats(wi, wo)
        cosine = cos_theta(wi) + xp.zeros_like(cos_theta(wo))
        return xp.where(cosine > 0, cosine / np.pi, xp.zeros_like(cosine))

    def confidence(self, wi: Array, wo: Array) -> Array:
        """How far to trust f there, (...) in [0, 1]: 1 of a formula, less far from what a fit was given."""
        xp, wi, wo = floats(wi, wo)
        return xp.ones_like((wi + wo)[..., 0])

    def lobes(self) -> tuple[BRDF, ...]:
        """Models of one lobe each whose sum is this one: each may be sampled and integrated by itself."""
        return (self,)

    def _strength(self, xp: Any, wo: Array) -> Array:
        """Roughly what is reflected at `wo`, (...): by it a sum shares its samples among its terms."""
        return xp.ones_like(wo[..., 2])

    def _lanes(self, *names: str) -> tuple[Array, ...]:
        """The named parameters, which are no colours, with an axis for the channels: (...) -> (..., 1)."""
        return tuple(to_numpy(getattr(self, name))[..., None] for name in names)

    @staticmethod
    def _mean(xp: Any, colour: Array, wo: Array) -> Array:
        """The mean over channels of a colour parameter, (...), broadcast to `wo` (..., 3)."""
        colour = like(colour, wo)
        return (xp.mean(colour, axis=-1) if colour.ndim else colour) + xp.zeros_like(wo[..., 2])

    def __add__(self, other: BRDF) -> BRDF:
        from .combine import Sum

        return Sum((self, other))

    def __mul__(self, factor: Array) -> BRDF:
        from .combine import Scaled

        return Scaled(self, factor)

    __rmul__ = __mul__
