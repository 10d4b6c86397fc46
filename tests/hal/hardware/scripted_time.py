"""The machine's clock for tests of clocks and loops: it goes on by what is slept, so nothing waits."""

from __future__ import annotations

from types import ModuleType, SimpleNamespace

import pytest


class Machine:
    """``time``: seconds; a sleep ends ``late`` seconds late."""

    def __init__(self, late: float = 0.0) -> None:
        self.time, self.late = 50.0, late

    def monotonic(self) -> float:
        return self.time

    def sleep(self, duration: float) -> None:
        self.time += max(duration, 1e-6) + self.late

    def in_place_of_time(self, module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Machine:
        """Let ``module`` read this clock instead of ``time``."""
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=self.monotonic, sleep=self.sleep))
        return self
