"""Where a picture of the surroundings stands in gonio's world, by the names of the tools that say so.

A picture has a right, an up and a centre. An orientation gives the world direction of each, for each kind of layout:

    own axes -> world:  M = (right, up, centre of the world) (right, up, centre of the layout's own axes)^T

For a lat-long map the centre is the middle of the middle row, right the direction a quarter of the width beside it,
up the top row. For a cross or strip they are the front, right and up faces (`cubes.py`); for discs see `discs.py`.

    name       lat-long: centre, right     cube: front, right face     tool's axes
    GONIO      -x, -y                      -y, +x                      z up, right-handed (gonio's own)
    PANORAMA   +y, +x                      +y, +x                      as one stands in it: ahead is +y of gonio's world
    PROBE      +Z, +X                      +Z, +X                      Y up; the frame of RH's tables
    BLENDER    +X, -Y                                                  Z up
    MITSUBA    +Z, -X                                                  Y up
    THREE_JS   +X, +Z                      +Z, -X                      Y up; cube textures are sampled with x flipped
    OPENEXR    +Z, -X                      -Z, +X                      Y up; `CubeStrip.openexr()`
    OPENGL                                 +Z, +X                      Y up; faces +X -X +Y -Y +Z -Z
    FILAMENT   +Z, -X                      +Z, -X                      Y up; cmgen's default, which mirrors
    FILAMENT_UNMIRRORED  +Z, +X            +Z, +X                      cmgen --no-mirror

Tools with Y up come into gonio's world by (X, Y, Z) -> (X, -Z, Y). A picture taken from inside, unmirrored, has
right = centre x up. GONIO, PROBE, OPENGL and FILAMENT_UNMIRRORED have the opposite: to them a panorama is mirrored.
So Debevec's angular maps, pictures in which a wall's writing can be read, are PANORAMA (his text: ahead is -Z), and
PROBE is the frame in which the coefficients of RH's table 4.1 hold. For a photograph of a mirror ball PROBE is right
as it is: Z points to the camera, and the ball mirrors.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from ..arrays import Array, to_numpy
from ..directions import cross, dot, normalise
from ..errors import DirectionError, ParameterError
from ..frames import require_rotation
from .cubes import CubeCross, CubeStrip
from .discs import AngularMap, DualParaboloid, MirrorBall
from .mappings import LatLongMap, Mapping

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
Z_UP = np.eye(3)

_KINDS: dict[type[Mapping], str] = {
    LatLongMap: "lat-long maps",
    AngularMap: "angular maps",
    MirrorBall: "mirror balls",
    DualParaboloid: "paraboloids",
    CubeCross: "cubes",
    CubeStrip: "cubes",
}


@dataclasses.dataclass(frozen=True, eq=False)
class Orientation:
    """`frames` holds, for each kind of layout, the world directions of a picture's right, up and centre as columns.

    The published ones are `Orientation.MITSUBA` and so on, all of them in `PUBLISHED` by name.
    """

    name: str
    frames: dict[str, np.ndarray]

    GONIO: ClassVar[Orientation]
    PANORAMA: ClassVar[Orientation]
    PROBE: ClassVar[Orientation]
    BLENDER: ClassVar[Orientation]
    MITSUBA: ClassVar[Orientation]
    THREE_JS: ClassVar[Orientation]
    OPENEXR: ClassVar[Orientation]
    OPENGL: ClassVar[Orientation]
    FILAMENT: ClassVar[Orientation]
    FILAMENT_UNMIRRORED: ClassVar[Orientation]

    @classmethod
    def looking(cls, centre: Array, up: Array = (0.0, 0.0, 1.0), mirrored: bool = False) -> Orientation:
        """A picture whose centre lies towards `centre` (3,) of the world, the right way up for `up` (3,).

        `mirrored` where right and left are exchanged against what one sees from inside (a mirror ball's picture is).
        Raises `DirectionError` where the two are parallel.
        """
        c = normalise(np.asarray(to_numpy(centre), np.float64), "centre")
        u = normalise(np.asarray(to_numpy(up), np.float64), "up")
        u = u - dot(u, c) * c
        if not dot(u, u) > 1e-12:
            raise DirectionError("up is parallel to centre; give one that leans away from it.")
        u = normalise(u)
        right = cross(c, u) * (-1.0 if mirrored else 1.0)
        return cls("looking", {kind: np.stack((right, u, c), axis=-1) for kind in set(_KINDS.values())})

    @classmethod
    def of(cls, name: str, mapping: Mapping, frame: np.ndarray) -> Orientation:
        """For layouts like `mapping` alone: the columns of `frame` (3, 3) are the world's right, up and centre.

        Raises `DirectionError` where these are not unit and orthogonal.
        """
        if frame.shape != (3, 3) or not np.allclose(frame.T @ frame, np.eye(3), atol=1e-6):
            raise DirectionError(f"right, up and centre of {name} are not three orthogonal unit directions.")
        return cls(name, {_KINDS[type(mapping)]: frame})

    def matrix(self, mapping: Mapping) -> np.ndarray:
        """(3, 3), orthogonal, determinant +1 or -1: own directions of `mapping` to world directions, w = M own.

        Raises `ParameterError` where the tool says nothing about this kind of layout.
        """
        kind = _KINDS[type(mapping)]
        if kind not in self.frames:
            raise ParameterError(
                f"orientation {self.name} says nothing about {kind}, only about {', '.join(self.frames)}. "
                "Name another, or say where the picture's centre points: Orientation.looking(...)."
            )
        turn: np.ndarray = self.frames[kind] @ mapping.picture.T
        return turn

    def rotated(self, rotation: Array) -> Orientation:
        """The same pictures after the world has been turned by `rotation` (3, 3): what was at w is at R w.

        Raises `DirectionError` where it is not a rotation.
        """
        require_rotation(rotation, "rotation")
        R = to_numpy(rotation).astype(np.float64)
        return Orientation(f"{self.name}, turned", {kind: R @ frame for kind, frame in self.frames.items()})


def _axis(name: str) -> np.ndarray:
    """ "+x" or "-x" (y, z) as a vector."""
    axis: np.ndarray = np.eye(3)["xyz".index(name[1])] * (1.0 if name[0] == "+" else -1.0)
    return axis


def _published(name: str, axes: np.ndarray, up: str, **pictures: tuple[str, ...]) -> Orientation:
    """`pictures`: (centre, right) in the tool's axes, and up where it differs, by kind of layout."""
    kinds = {
        "latlong": ["lat-long maps"],
        "disc": ["angular maps", "mirror balls"],
        "paraboloid": ["paraboloids"],
        "cube": ["cubes"],
    }
    frames: dict[str, np.ndarray] = {}
    for picture, (centre, right, *own_up) in pictures.items():
        frame = axes @ np.stack((_axis(right), _axis(own_up[0] if own_up else up), _axis(centre)), axis=-1)
        frames |= dict.fromkeys(kinds[picture], frame)
    return Orientation(name, frames)


def _everywhere(*picture: str) -> dict[str, tuple[str, ...]]:
    return dict.fromkeys(("latlong", "disc", "paraboloid", "cube"), picture)


_ALL = (
    _published("GONIO", Z_UP, "+z", **_everywhere("-y", "+x") | {"latlong": ("-x", "-y")}),
    _published("PANORAMA", Z_UP, "+z", **_everywhere("+y", "+x")),
    # The pairs that go around of Debevec's probes show -Z first, upside down.
    _published("PROBE", Y_UP, "+y", **_everywhere("+z", "+x") | {"paraboloid": ("-z", "+x", "-y")}),
    _published("BLENDER", Z_UP, "+z", latlong=("+x", "-y")),
    _published("MITSUBA", Y_UP, "+y", latlong=("+z", "-x")),
    _published("THREE_JS", Y_UP, "+y", latlong=("+x", "+z"), cube=("+z", "-x")),
    _published("OPENEXR", Y_UP, "+y", latlong=("+z", "-x"), cube=("-z", "+x")),
    _published("OPENGL", Y_UP, "+y", cube=("+z", "+x")),
    _published("FILAMENT", Y_UP, "+y", latlong=("+z", "-x"), cube=("+z", "-x")),
    _published("FILAMENT_UNMIRRORED", Y_UP, "+y", latlong=("+z", "+x"), cube=("+z", "+x")),
)
PUBLISHED = {orientation.name: orientation for orientation in _ALL}
for _name, _orientation in PUBLISHED.items():
    setattr(Orientation, _name, _orientation)
