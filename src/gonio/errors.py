"""Everything gonio refuses or warns about, by name.

An error says what came, where, and the way out. A warning names data that can still be used but not trusted whole.
"""

from __future__ import annotations

# Bytes that one answer may take unless the caller allows more: beyond it, `MemoryLimitError`.
MEMORY_LIMIT = 4_000_000_000


class GonioError(ValueError):
    """The root of all refusals: `except gonio.GonioError` catches every one of them and nothing else."""


class ArrayError(GonioError):
    """An array has the wrong shape, dtype, or values (NaN, infinite, empty)."""


class DirectionError(GonioError):
    """A direction is not a unit vector, or not where it must be."""


class ParameterError(GonioError):
    """A parameter of a model, light, camera or grid lies outside its range."""


class FileError(GonioError):
    """A file cannot be read or written; the message starts with its name and names the field at fault."""


class MissingExtraError(GonioError, ImportError):
    """An optional package is not installed; the message says which extra brings it."""


class MemoryLimitError(GonioError):
    """The work would not fit the memory limit; said before any memory is taken."""


class GonioWarning(UserWarning):
    """The root of all warnings."""


class ClippedWarning(GonioWarning):
    """Pixels stand at the brightest value that the file can hold: their radiance is a lower bound."""


class NegativeWarning(GonioWarning):
    """Radiance or reflectance below zero was found where none can be."""


class PhysicsWarning(GonioWarning):
    """A BRDF reflects more than it receives, or changes when light and eye change places."""


class EncodingWarning(GonioWarning):
    """The encoding of a file had to be assumed (an 8-bit photograph taken for sRGB)."""


class AlphaWarning(GonioWarning):
    """Transparency was left out: what stands behind or under transparent pixels is unknown."""


class AccuracyWarning(GonioWarning):
    """A result is less accurate than its grid, degree or sample count suggests."""


class GeometryWarning(GonioWarning):
    """A mesh has faces without area; they are left out."""
