"""Digital inputs and outputs of the control box and of the tool flange."""

from __future__ import annotations

from typing import Literal

from hal.api import CommandRefusedError, NoDataError
from hal.parts import StopLatch
from hal.ur.link import URLink
from hal.ur.sdk_process import Report

Kind = Literal["standard", "configurable", "tool"]
FIRST = {"standard": 0, "configurable": 8, "tool": 16}
COUNT = {"standard": 8, "configurable": 8, "tool": 2}
TIMEOUT = 1.0


class URDigitalIO:
    """Eight standard and eight configurable channels, two of the tool; numbered from 0."""

    def __init__(self, link: URLink, latch: StopLatch) -> None:
        self._link, self._latch = link, latch

    def set_output(self, kind: Kind, number: int, on: bool) -> None:
        """Switch an output; refused while the robot is stopped. ConnectionFailedError where nobody answers."""
        self._latch.check("digital output", "set_output")
        self._check(kind, number)
        self._link.call("set_output", kind, number, bool(on), timeout=TIMEOUT)

    def output(self, kind: Kind, number: int) -> bool:
        """Whether an output is on."""
        self._check(kind, number)
        return bool(self._report().digital_outputs >> (FIRST[kind] + number) & 1)

    def input(self, kind: Kind, number: int) -> bool:
        """Whether an input is on."""
        self._check(kind, number)
        return bool(self._report().digital_inputs >> (FIRST[kind] + number) & 1)

    def _report(self) -> Report:
        report = self._link.report
        if report is None:
            raise NoDataError("the UR has told nothing of its inputs and outputs yet")
        return report

    @staticmethod
    def _check(kind: str, number: int) -> None:
        if kind not in COUNT or not 0 <= number < COUNT[kind]:
            raise CommandRefusedError(f"there is no {kind} input or output {number}")
