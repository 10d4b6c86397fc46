"""How much processor time plans and ticks of local planners take, noted while a session runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bestman_bt.navigation.local_planning.base import PathFollower


@contextmanager
def timed_calls(owner: type, method: str, note: Callable[[float], None]) -> Iterator[None]:
    """``note`` is told of every call of a method how many seconds this process computed."""
    plain = getattr(owner, method)

    def measured(*arguments: Any, **keywords: Any) -> Any:
        begin = time.process_time()
        result = plain(*arguments, **keywords)
        note(time.process_time() - begin)
        return result

    inherited = method not in vars(owner)
    setattr(owner, method, measured)
    try:
        yield
    finally:
        if inherited:
            delattr(owner, method)
        else:
            setattr(owner, method, plain)


@contextmanager
def timed_ticks(follower: type[PathFollower], ticks: list[float]) -> Iterator[None]:
    """Note what each tick of a follower takes, seconds: the command, and the scan before it, where one came."""
    scans: list[float] = []

    def note(command: float) -> None:
        ticks.append(command + sum(scans))
        scans.clear()

    with timed_calls(follower, "observe", scans.append), timed_calls(follower, "compute", note):
        yield
