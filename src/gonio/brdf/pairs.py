"""All pairs of directions through one compiled loop, without the pairs being made.

    wi (1, K, 3), wo (P, 1, 3), alpha (P, 1)  ->  f (P, K, C):  the loop reads K + P directions and P parameters

Operands that broadcast are walked with step zero. Axes along which all operands step alike are merged, so that a loop
over two indices serves every shape; further axes, which are rare, are looped over in Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Array, to_numpy


def through(
    kernel: Callable[..., None], wi: np.ndarray, wo: np.ndarray, parameters: Sequence[Array], *codes: int
) -> Array:
    """f (..., C) of NumPy directions (..., 3), (..., 3) and `parameters`, each (..., C) with C = 1 or 3, all broadcast.

    The kernel is called as `kernel(wi, wo, p, steps, out, *codes)`: flat arrays, the two steps of each in elements, and
    out (P, K, C). The parameters of one site lie in p channel by channel: p[channel * len(parameters) + k].
    """
    # Parameters stay in double precision, so that each kernel is compiled once for either precision of directions.
    columns = (np.atleast_1d(to_numpy(p).astype(np.float64, copy=False)) for p in parameters)
    block = np.stack(np.broadcast_arrays(*columns), axis=-1)
    lead = np.broadcast_shapes(wi.shape[:-1], wo.shape[:-1], block.shape[:-2])
    channels = block.shape[-2]
    out = np.empty((*lead, channels), wi.dtype)
    if out.size == 0:
        return out
    operands = [_trimmed(wi, len(lead), 1), _trimmed(wo, len(lead), 1), _trimmed(block, len(lead), 2)]
    sizes, steps = _merged(lead, [x.shape[: len(lead)] for x in operands], (3, 3, math.prod(block.shape[-2:])))
    flat = [x.reshape(-1) for x in operands]
    for x in flat:
        x.flags.writeable = False  # of the view only: read-only and writable input take one compiled loop
    views = out.reshape(*sizes, channels)
    for index in np.ndindex(*sizes[:-2]):
        parts = [
            x[sum(i * s for i, s in zip(index, step, strict=False)) :] for x, step in zip(flat, steps, strict=True)
        ]
        kernel(*parts, tuple(s for step in steps for s in step[-2:]), views[index], *codes)
    return out


def _trimmed(x: np.ndarray, rank: int, inner: int) -> np.ndarray:
    """`x` with `rank` leading axes, contiguous; axes that an earlier broadcast repeated are cut back to one entry."""
    x = x[(None,) * (rank + inner - x.ndim)]
    return np.ascontiguousarray(x[tuple(slice(1) if step == 0 else slice(None) for step in x.strides[:rank])])


def _merged(
    lead: tuple[int, ...], shapes: list[tuple[int, ...]], inner: tuple[int, ...]
) -> tuple[list[int], list[list[int]]]:
    """The sizes of the merged axes, at least two, and for each operand its step along each."""
    sizes: list[int] = []
    steps: list[list[int]] = [[] for _ in shapes]
    last = None
    strides = list(inner)
    for axis in reversed(range(len(lead))):
        if lead[axis] == 1:
            continue
        moves = tuple(shape[axis] > 1 for shape in shapes)
        if moves == last:
            sizes[0] *= lead[axis]
        else:
            sizes.insert(0, lead[axis])
            for k, step in enumerate(steps):
                step.insert(0, strides[k] if moves[k] else 0)
        strides = [stride * shape[axis] for stride, shape in zip(strides, shapes, strict=True)]
        last = moves
    while len(sizes) < 2:
        sizes.insert(0, 1)
        for step in steps:
            step.insert(0, 0)
    return sizes, steps
