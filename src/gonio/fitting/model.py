"""What every estimator answers: a value, and how far to trust it."""

from __future__ import annotations

import dataclasses
from typing import Generic, TypeVar

T = TypeVar("T", covariant=True)


@dataclasses.dataclass(frozen=True, eq=False)
class Fit(Generic[T]):
    """`value` as it was found; `residual`, what is left of the data, relative, rms; whether the solve `converged`, and
    the `reason` why it ended; `history` (K, 2), how the residual fell: a count of what grew, and the residual there."""

    value: T
    residual: float
    converged: bool
    reason: str
    history: tuple[tuple[int, float], ...] = ()
