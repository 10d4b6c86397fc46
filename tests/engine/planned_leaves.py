"""Leaves that do what a test has planned, tick by tick."""

from __future__ import annotations

from typing import Any

from bestman_bt.engine import FAILURE, RUNNING, SKIPPED, SUCCESS, PortInformation, StatefulAction

LETTERS = {"R": RUNNING, "S": SUCCESS, "F": FAILURE, "K": SKIPPED}


class Plan(StatefulAction):
    """One letter a tick; the last repeats."""

    INPUT_PORTS = {"plan": PortInformation(str)}

    def on_load(self) -> None:
        self.ticks = 0
        self.halts = 0

    def on_start(self) -> int:
        return self.on_running()

    def on_running(self) -> int:
        plan = self.get_input("plan")
        self.ticks += 1
        return LETTERS[plan[min(self.ticks, len(plan)) - 1]]

    def on_halted(self) -> None:
        self.halts += 1


class Again(Plan):
    """The same, asked anew at every tick, also after a result."""

    def on_tick(self) -> int:
        return self.on_running()


def ticks(tree: Any, count: int) -> list[int]:
    return [tree.tick_exactly_once() for _ in range(count)]
