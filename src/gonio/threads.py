"""How many threads there are to work with, and BLAS that leaves them to us.

Where threads of ours call small products and solves, threads of BLAS's own wait for one another and for processors that
are taken: a fit of 256 sites took six times as long on two busy cores.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Products and solves within take the thread that they are called from."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
