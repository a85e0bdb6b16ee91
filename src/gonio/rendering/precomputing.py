"""Images of a view for all light there is, compressed as they are made: what `Precomputed` plays.

    T_b ~ U_b A_b Q^T           |T - U A Q^T|^2 = |T|^2 - |A|^2, U_b and Q orthonormal

T is divided by the root of each cell's solid angle, so that its norm is that of images under white noise for light.
Blocks come one after another; Q, the lights seen so far, grows where a block shows more than they explain, and of a
block only U_b and A_b are kept. At the end one PCA of all A shortens Q to the lights that matter, and one of each block
its images, the least in all blocks first, until the error that is asked for is used up. What is left out adds up
exactly at every step.

Memory: T of as many blocks as there are threads, Q (K, R), and all U_b and A_b as first kept.
"""

from __future__ import annotations

import math
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from ..errors import MEMORY_LIMIT, AccuracyWarning, ArrayError, MemoryLimitError, ParameterError
from ..reflection import PAIRS, textured
from ..shapes.mesh import Mesh
from ..threads import processors
from .precomputed import Cells, Precomputed, blocks
from .relight import Relightable

# Parts of the error^2 asked for: what each block may lose on the way, what the lights may lose at the end.
_ON_THE_WAY = 1 / 16
_LIGHTS = 1 / 2
# What half floats of each of the three factors cost at most, rms; errors beyond `_FINE` leave room for it.
_HALVES = 3e-4
_FINE = 2e-3
_MOST_SAMPLES = 8
_TRIED = 48  # pixels at which samples are chosen


def precompute(
    thing: Relightable,
    *,
    error: float = 0.02,
    side: int = 16,
    block: int = 8,
    shadows: bool = True,
    samples: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Precomputed:
    """The view of `thing` for all distant light, its images off by `error` of their rms under white noise for light.

    side: cells of light along the edge of a cube, 6 side^2 in all; detail of the light finer than 90/side degrees is
    averaged. block: pixels along the side of a block. shadows: those that `thing.caster` casts.
    samples^2 directions are taken in each cell; None takes as many as `error` needs for the material's lobes.
    progress(done, total): pixels.

    Smooth light leaves less error than white noise does, a lone lamp more. Warns with `AccuracyWarning` where lobes
    are too narrow for the samples. Raises `ParameterError` for numbers out of range, `ArrayError` where the material
    is not finite, `MemoryLimitError` where what is kept outgrows the limit.
    """
    if not 0 < error < 1:
        raise ParameterError(f"error = {error!r} lies outside (0, 1).")
    for name, value in {"block": block, "samples": 1 if samples is None else samples}.items():
        if not isinstance(value, int | np.integer) or value < 1:
            raise ParameterError(f"{name} = {value!r} is not a whole number >= 1.")
    cells = Cells(side)
    responses = _Responses(thing, cells, shadows)
    at, counts = blocks(thing.view.mask, block)
    samples = responses.samples(at, error) if samples is None else samples
    kept = _Kept(len(cells), error**2 - (3 * _HALVES**2 if error > _FINE else 0.0))
    done = np.cumsum(counts)
    for k, T in enumerate(responses.of(np.split(at, done[:-1]), samples)):
        kept.add(T)
        if progress is not None:
            progress(int(done[k]), at.size)
    U, A, W = kept.shortened()
    D = W * np.sqrt(cells.solid_angles, dtype=np.float32)[:, None]
    lost = kept.lost
    if error > _FINE:
        U, A, D, rounded = _halved(U, A, D, cells.solid_angles, 3 * _HALVES**2 * kept.total)
        lost += rounded
    # Rows of U are pixels, one colour after the other.
    images = [u.reshape(len(u) // n, n, u.shape[1]).swapaxes(1, 2).ravel() for u, n in zip(U, counts, strict=True)]
    return Precomputed(
        mask=thing.view.mask,
        block=block,
        ranks=np.array([len(a) for a in A], np.int32),
        images=np.concatenate(images),
        mixtures=np.concatenate(A),
        lights=D,
        cells=cells,
        error=math.sqrt(lost / max(kept.total, 1e-30)),
    )


def _halved(
    U: list[np.ndarray], A: list[np.ndarray], D: np.ndarray, solid: np.ndarray, most: float
) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray, float]:
    """The factors as half floats hold them, and what of |T|^2 that costs; as they are where it is more than `most`."""
    with np.errstate(over="ignore", invalid="ignore"):
        u, a, d = [_half(x) for x in U], [_half(x) for x in A], _half(D)
        lost = sum(_square((x - y) @ z) + _square(w - z) for x, y, w, z in zip(U, u, A, a, strict=True))
        off = (D - d) / np.sqrt(solid, dtype=np.float32)[:, None]
        lost += float(np.vdot(off.T @ off, sum((x.T @ x for x in A), np.zeros((D.shape[1],) * 2, np.float32))))
    return (u, a, d, lost) if lost <= most else (U, A, D, 0.0)


def _half(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float16).astype(np.float32)


class _Responses:
    """T of pixels: rows colour by colour, columns by cells, divided by the root of their solid angle."""

    def __init__(self, thing: Relightable, cells: Cells, shadows: bool) -> None:
        view = thing.view
        self.thing, self.cells = thing, cells
        self.shape = thing.caster if shadows else None
        self.frames = view.frames.reshape(-1, 3, 3).astype(np.float32)
        self.wo = view.wo.reshape(-1, 3).astype(np.float32)
        self.lifted = view.lifted.reshape(-1, 3)
        self.uv = None if view.uv is None else view.uv.reshape(-1, 2)
        if self.shape is not None:
            up = np.array([[0.0, 0.0, 1.0]])
            self.shape.occluded(up, up)  # builds the ray tracer, before threads would each build one
        if thing.residuals is not None:
            self.place = np.cumsum(view.mask) - 1  # of a pixel among those of the mask
            directions, weights = self._grid(2)
            of_lights = thing.residuals.weights(directions.reshape(-1, 3)).reshape(*weights.shape, -1)
            self.shares = np.einsum("sk,skn->nk", weights, of_lights).astype(np.float32)

    def of(self, parts: Sequence[np.ndarray], samples: int) -> Iterator[np.ndarray]:
        """T (C P, K) of each of the blocks, float32, made on threads and as many ahead of time."""
        grid = self._grid(samples)
        threads = processors()
        with ThreadPoolExecutor(threads) as pool:
            made: deque[Future[np.ndarray]] = deque()
            for part in parts:
                made.append(pool.submit(self._block, part, grid, self.shape))
                if len(made) > threads:
                    yield made.popleft().result()
            while made:
                yield made.popleft().result()

    def samples(self, at: np.ndarray, error: float) -> int:
        """Directions along a cell's side that hold T, without shadows, to half of `error` at a few pixels."""
        few = at[:: -(-at.size // _TRIED)]
        n, coarse = 1, self._block(few, self._grid(1), None)
        while n < _MOST_SAMPLES:
            fine = self._block(few, self._grid(2 * n), None)
            off = float(np.linalg.norm(fine - coarse)) / max(float(np.linalg.norm(fine)), 1e-30)
            if off <= error / 2:
                return n
            n, coarse = 2 * n, fine
            if off <= 2 * error:  # the midpoint rule: twice as many are off by a fourth
                return n
        warnings.warn(
            f"{n} x {n} directions in each cell leave the material's narrowest lobes about {off / 4:.1g} off; pass "
            "more samples, or cells of a larger side.",
            AccuracyWarning,
            stacklevel=3,
        )
        return n

    def _grid(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        directions, solid = self.cells.directions(samples)
        return directions.astype(np.float32), (solid / np.sqrt(self.cells.solid_angles)).astype(np.float32)

    def _block(self, at: np.ndarray, grid: tuple[np.ndarray, np.ndarray], shape: Mesh | None) -> np.ndarray:
        directions, weights = grid
        material = textured(self.thing.material, None if self.uv is None else self.uv[at])
        frames, wo = self.frames[at], self.wo[at]
        axes = frames.reshape(-1, 3).T
        wo = (frames @ wo[..., None])[..., 0]
        lit = np.flatnonzero((directions @ frames[:, 2].T > 0).any(axis=(0, 2)))
        step = max(1, PAIRS // (len(directions) * at.size))
        T: np.ndarray | None = None
        for low in range(0, lit.size, step):
            some = lit[low : low + step]
            w = directions[:, some].reshape(-1, 3)
            wi = (w @ axes).reshape(-1, at.size, 3)
            weight = np.maximum(wi[..., 2], 0) * weights[:, some].reshape(-1, 1)
            if shape is not None:
                beam, site = np.nonzero(weight)
                weight[beam, site] *= ~shape.occluded(self.lifted[at[site]], w[beam])
            f = material.evaluate(np, wi, wo)
            if T is None:
                T = np.zeros((f.shape[-1], at.size, len(self.cells)), np.float32)
            of_cells = (f * weight[..., None]).reshape(-1, some.size, at.size, f.shape[-1]).sum(axis=0)
            T[..., some] = of_cells.transpose(2, 1, 0)
        if T is None:
            T = np.zeros((1, at.size, len(self.cells)), np.float32)
        if self.thing.residuals is not None:
            images = self.thing.residuals.images[:, self.place[at]]
            T = T + images.transpose(2, 1, 0) @ self.shares
        if not np.isfinite(T).all():
            raise ArrayError("the material's f is not finite at some pixels.")
        return T.reshape(-1, len(self.cells))


class _Kept:
    """T ~ U A Q^T of the blocks so far; `lost` of `total` |T|^2, of which `most` may be lost in all."""

    def __init__(self, cells: int, most: float) -> None:
        self.most, self.lost, self.total = most, 0.0, 0.0
        self.Q = np.zeros((cells, 0), np.float32)
        self.U: list[np.ndarray] = []
        self.A: list[np.ndarray] = []

    def add(self, T: np.ndarray) -> None:
        """Take in a block, T (rows, K)."""
        energy = _square(T)
        spare = _ON_THE_WAY / 2 * self.most * energy
        Z = T @ self.Q
        D = T - Z @ self.Q.T
        if _square(D) > spare:
            # Half of what may be left, so that not every block adds a light.
            new = self._orthogonal(_explaining(D, spare / 2))
            self.Q = np.concatenate((self.Q, new), axis=1)
            Z = np.concatenate((Z, T @ new), axis=1)
            D -= Z[:, -new.shape[1] :] @ new.T
        U, s, V = np.linalg.svd(Z, full_matrices=False)
        rank = _needed(s.astype(np.float64) ** 2, spare)
        self.total += energy
        self.lost += _square(D) + _square(s[rank:])
        self.U.append(U[:, :rank])
        self.A.append(s[:rank, None] * V[:rank])
        taken = 8 * sum(map(len, self.A)) * self.Q.shape[1]
        if taken > MEMORY_LIMIT:
            raise MemoryLimitError(
                f"{len(self.A)} blocks take {taken / 1e9:.1f} GB already, the limit is {MEMORY_LIMIT / 1e9:g} GB: the "
                "material mirrors. Ask for a larger error, or for cells of a smaller side."
            )

    def shortened(self) -> tuple[list[np.ndarray], list[np.ndarray], np.ndarray]:
        """(U, A, W), with the fewest lights W (K, R), and after them the fewest images, that `most` allows."""
        gram = np.zeros((self.Q.shape[1],) * 2)
        for a in self.A:
            a = a.astype(np.float64)
            gram[: a.shape[1], : a.shape[1]] += a.T @ a
        value, V = np.linalg.eigh(gram)
        value, V = np.maximum(value[::-1], 0), V[:, ::-1].astype(np.float32)
        lights = _needed(value, _LIGHTS * (self.most * self.total - self.lost))
        self.lost += float(value[lights:].sum())
        V = V[:, :lights]
        U, A, s = [], [], []
        for u, a in zip(self.U, self.A, strict=True):
            x, values, y = np.linalg.svd(a @ V[: a.shape[1]], full_matrices=False)
            U.append(u @ x)
            A.append(values[:, None] * y)
            s.append(values.astype(np.float64) ** 2)
        every = np.sort(np.concatenate(s))[::-1]
        images = _needed(every, self.most * self.total - self.lost)
        least = every[images - 1] if images else np.inf
        self.lost += float(every[every < least].sum())
        ranks = [int(np.count_nonzero(squares >= least)) for squares in s]
        return (
            [u[:, :r] for u, r in zip(U, ranks, strict=True)],
            [a[:r] for a, r in zip(A, ranks, strict=True)],
            self.Q @ V,
        )

    def _orthogonal(self, V: np.ndarray) -> np.ndarray:
        """V (K, n), orthonormal and orthogonal to Q."""
        for _ in range(2):
            V, _ = np.linalg.qr(V - self.Q @ (self.Q.T @ V))
        return V


def _explaining(D: np.ndarray, spare: float) -> np.ndarray:
    """The fewest directions (K, n) that hold all of D (rows, K) but `spare` of its square."""
    wide = D.shape[0] < D.shape[1]
    value, E = np.linalg.eigh(np.matmul(D, D.T, dtype=np.float64) if wide else np.matmul(D.T, D, dtype=np.float64))
    n = max(_needed(np.maximum(value[::-1], 0), spare), 1)
    found: np.ndarray = (E[:, ::-1][:, :n] / np.sqrt(value[::-1][:n])).astype(np.float32)
    return D.T @ found if wide else found


def _needed(descending: np.ndarray, spare: float) -> int:
    """How many of the numbers are left where the last ones, adding up to `spare` at most, are dropped."""
    return int(np.count_nonzero(np.cumsum(descending[::-1]) > spare))


def _square(x: np.ndarray) -> float:
    return float(np.linalg.norm(x)) ** 2
