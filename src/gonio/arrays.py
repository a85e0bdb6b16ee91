"""Which array library is in use: the only place that asks (array API standard, through array-api-compat).

    xp, wi, wo = floats(wi, wo)      # one namespace, one floating dtype, one device
    alpha = like(self.alpha, wi)     # a model's parameter, brought to where the data are

NumPy by default; PyTorch and CuPy arrays are answered in kind, on their device, in their floating dtype.
"""

from __future__ import annotations

import importlib
from typing import Any, TypeAlias

import array_api_compat as compat
import numpy as np

from .errors import ArrayError

_NUMPY = compat.array_namespace(np.empty(0))
_DTYPES = (np.dtype(np.float32), np.dtype(np.float64))

Array: TypeAlias = Any  # a NumPy, PyTorch or CuPy array, or what np.asarray takes


def namespace(*arrays: Array) -> Any:
    """The array-API namespace of `arrays`; lists and numbers adapt to the arrays beside them, NumPy where alone.

    Raises `ArrayError` where arrays of two libraries are mixed.
    """
    if all(type(a) is np.ndarray for a in arrays):
        return _NUMPY
    found = [a for a in arrays if _leads(a)] or [np.empty(0)]
    try:
        return compat.array_namespace(*found)
    except TypeError as error:
        kinds = sorted({type(a).__module__.split(".")[0] for a in found})
        raise ArrayError(f"arrays of {' and '.join(kinds)} are mixed. Bring them to one library and device.") from error


def is_numpy(*arrays: Array) -> bool:
    """True where every array is NumPy's (or a list or number, which becomes NumPy's): the kernels may be used."""
    return all(type(a) is np.ndarray for a in arrays) or not any(
        _leads(a) and not compat.is_numpy_array(a) for a in arrays
    )


def floats(*arrays: Array) -> tuple[Any, ...]:
    """`(xp, *arrays)`: the common namespace, and each array in it with one floating dtype on one device.

    The widest floating dtype among the arrays is kept (half becomes single, since no sum survives in half); where
    none is floating, float64. Lists and Python numbers adapt to the arrays beside them.

    Raises `ArrayError` where an array is complex, or holds no numbers.
    """
    # The common case by a short way: arrays of NumPy alike in dtype are what they should be.
    if all(type(a) is np.ndarray and a.dtype in _DTYPES and a.dtype == arrays[0].dtype for a in arrays):
        return _NUMPY, *arrays
    xp = namespace(*arrays)
    given = [a for a in arrays if _leads(a)]
    kinds = [a.dtype for a in given if xp.isdtype(a.dtype, "real floating")]
    dtype = xp.float32 if kinds and all(k != xp.float64 for k in kinds) else xp.float64
    device = compat.device(given[0]) if given else None
    return xp, *(_cast(a, xp, dtype, device) for a in arrays)


def like(x: Array, reference: Array) -> Array:
    """`x` as an array of `reference`'s library, floating dtype and device (gradients of a tensor are kept)."""
    xp = compat.array_namespace(reference)
    return _cast(x, xp, reference.dtype, compat.device(reference))


def to_numpy(x: Array) -> np.ndarray:
    """`x` as a NumPy array in main memory."""
    if compat.is_torch_array(x):
        return np.asarray(x.detach().cpu())
    if compat.is_cupy_array(x):
        return np.asarray(x.get())
    return np.asarray(x)


def special(x: Array) -> Any:
    """The special functions (`erf`, `erfinv`, `gammaln`) of the library that `x` belongs to."""
    if compat.is_torch_array(x):
        return importlib.import_module("torch").special
    if compat.is_cupy_array(x):
        return importlib.import_module("cupyx.scipy.special")
    return importlib.import_module("scipy.special")


def require_finite(x: Array, name: str) -> None:
    """Raises `ArrayError` naming the first entry of `x` that is NaN or infinite."""
    xp = namespace(x)
    good = xp.isfinite(x)
    if not bool(xp.all(good)):
        at = tuple(int(k) for k in np.argwhere(~to_numpy(good))[0])
        index = f"[{', '.join(map(str, at))}]" if at else ""
        raise ArrayError(f"{name}{index} is {float(to_numpy(x)[at])}. Mask or mend such entries before passing them.")


def require_broadcast(**arrays: Array) -> None:
    """Raises `ArrayError` naming the arrays and their shapes where they do not broadcast against each other."""
    try:
        np.broadcast_shapes(*(tuple(a.shape) for a in arrays.values()))
    except ValueError as error:
        shapes = " and ".join(f"{name} {tuple(a.shape)}" for name, a in arrays.items())
        raise ArrayError(f"{shapes} do not broadcast against each other.") from error


def frozen(x: Array, dtype: Any = np.float64) -> Array:
    """A read-only NumPy copy of `x` to hold in a model (a tensor is held as it is, so that gradients reach it).

    What owns its memory and is read-only already, as what another model holds, is no other's to change: not copied.
    """
    if compat.is_array_api_obj(x) and not compat.is_numpy_array(x):
        return x
    if type(x) is np.ndarray and x.dtype == dtype and x.flags.owndata and not x.flags.writeable:
        return x
    copy = np.array(x, dtype=dtype)
    copy.flags.writeable = False
    return copy


def _leads(x: Array) -> bool:
    """Whether `x` decides library and dtype: an array does, a number or list (or NumPy's scalars) does not."""
    return bool(compat.is_array_api_obj(x)) and not isinstance(x, np.generic)


def _cast(x: Array, xp: Any, dtype: Any, device: Any) -> Array:
    if not _leads(x) or (compat.is_numpy_array(x) and not compat.is_numpy_namespace(xp)):
        try:
            values = np.asarray(x)
        except ValueError as error:
            raise ArrayError(f"expected real numbers in even rows, got {x!r:.60}") from error
        if values.dtype.kind not in "fiub":
            raise ArrayError(f"expected real numbers, got {x!r:.60}")
        # A copy, since PyTorch cannot hold read-only memory.
        return xp.asarray(values.astype(to_numpy(xp.empty(0, dtype=dtype)).dtype), device=device)
    if not xp.isdtype(x.dtype, ("real floating", "integral", "bool")):
        raise ArrayError(f"expected real numbers, got dtype {x.dtype}")
    if x.dtype != dtype:
        x = xp.astype(x, dtype)
    return x if device is None or compat.device(x) == device else compat.to_device(x, device)
