"""What long work tells and is asked: a bar on stderr with the time left, and whether Ctrl-C wants what there is."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """`with bar("render") as progress: work(progress=progress)`. Silent where stderr is not a terminal."""
    with steps(label) as progress:
        yield lambda done, total: progress(label, done, total)


@contextmanager
def steps(label: str) -> Iterator[Callable[[str, int, int], None]]:
    """The same for work that tells (step, done, total): each step begins the bar anew, under its own name."""
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeElapsedColumn(),
        progress.TextColumn("left"),
        progress.TimeRemainingColumn(),
    )
    stderr = Console(file=sys.stderr)
    with progress.Progress(*columns, console=stderr, disable=not sys.stderr.isatty(), transient=True) as shown:
        task, now = shown.add_task(label, total=None), label

        def heard(step: str, done: int, total: int) -> None:
            nonlocal now
            if step != now:
                now = step
                shown.reset(task, description=step)
            shown.update(task, completed=done, total=total)

        yield heard


@contextmanager
def stoppable(progress: Callable[[int, int], None]) -> Iterator[tuple[Callable[[int, int], None], Callable[[], bool]]]:
    """`with stoppable(progress) as (heard, stopped): work(progress=heard, until=stopped)`.

    Once the work was heard of, Ctrl-C asks it to end with what there is; a second one ends it at once, as the first
    does before.
    """
    begun = asked = False

    def heard(done: int, total: int) -> None:
        nonlocal begun
        begun = True
        progress(done, total)

    def interrupt(*_: object) -> None:
        nonlocal asked
        if asked or not begun:
            raise KeyboardInterrupt
        asked = True
        print("gonio: stopping with what there is; once more ends at once", file=sys.stderr)

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:  # as in the background of a shell
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield heard, lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)
