"""Environment maps as a person names them: their layouts, and the tools whose orientation they follow."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ParameterError

if TYPE_CHECKING:
    from ..lights.environment import Environment
    from ..lights.mappings import Mapping
    from ..lights.orientation import Orientation


class Layout(enum.StrEnum):
    """Layouts of environment maps by name."""

    LATLONG = "latlong"
    ANGULAR = "angular"
    BALL = "ball"
    PARABOLOID = "paraboloid"
    CROSS = "cross"
    CROSS_WIDE = "cross-wide"
    STRIP = "strip"
    STRIP_WIDE = "strip-wide"

    def mapping(self) -> Mapping:
        """The layout itself."""
        import gonio as gn

        return {
            Layout.LATLONG: gn.LatLongMap(),
            Layout.ANGULAR: gn.AngularMap(),
            Layout.BALL: gn.MirrorBall(),
            Layout.PARABOLOID: gn.DualParaboloid(),
            Layout.CROSS: gn.CubeCross(vertical=True),
            Layout.CROSS_WIDE: gn.CubeCross(vertical=False),
            Layout.STRIP: gn.CubeStrip(vertical=True),
            Layout.STRIP_WIDE: gn.CubeStrip(vertical=False),
        }[self]


def read(files: Sequence[Path], layout: Layout | None, orientation: str) -> Environment:
    """The environment in one file or its parts, taken as the two words say, or as its header and shape tell."""
    import gonio as gn

    mapping = layout.mapping() if layout else None
    return gn.read_environment(files[0] if len(files) == 1 else files, mapping, named(orientation))


def stands(environment: Environment) -> str:
    """Layout and orientation in two words."""
    return f"{type(environment.mapping).__name__} {environment.orientation.name}"


def named(orientation: str) -> Orientation | None:
    """The published orientation of that name; None for none."""
    if not orientation:
        return None
    from gonio.lights.orientation import PUBLISHED

    key = orientation.upper().replace("-", "_").replace(".", "_")
    if key not in PUBLISHED:
        known = ", ".join(name.lower().replace("_", "-") for name in PUBLISHED)
        raise ParameterError(f"'{orientation}' is no published orientation; those are {known}.")
    return PUBLISHED[key]
