"""Guards against access to the simulation that bypasses the Robotics API: such reads and actions are counted."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from enum import Enum
from typing import Any

from hal.simulation.engine import Engine

SIMULATION = "hal.simulation."
"""Prefixes of the simulation's modules."""

TRUTH = frozenset(
    {
        "joint_states",
        "body_pose",
        "body_velocity",
        "link_pose",
        "link_motions",
        "contacts",
        "gaps",
        "cast_rays",
        "depth_image",
        "photo",
        "segments",
    }
)
KINDS = {
    **dict.fromkeys(TRUTH | {"friction", "constants", "constraint_count"}, "truth_reads"),
    "put": "resets",
    "set_joint": "resets",
}
"""The kinds under which functions of an engine are counted; all others are tampering: motors are commanded through the
Robotics API, whose parts get the engine from ``Simulation.actor``.
"""
OWN = frozenset({"joint_states"})
"""Those of these functions that are allowed for the robot's own body: its encoders."""


class ReadPurpose(Enum):
    """Purposes for which a part of the simulation reads true poses."""

    SENSOR = "sensor"  # to render an image or cast a scan
    MONITOR = "monitor"  # the audit itself
    EVALUATION = "evaluation"
    RECORDING = "recording"
    SCRIPT = "script"  # the view of interventions


class GuardedEngine:
    """The engine that is accessible to any code through the robot: its functions are attributes, and each call is
    counted.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._engine, name)
        if inspect.isroutine(found):
            found = self._counted(name, found)
        self.__dict__[name] = found  # the next call finds it without coming here
        return found

    def _counted(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        ledger, robot = self._engine.ledger, self._engine.built.robot

        def counted(*arguments: Any, **keywords: Any) -> Any:
            if not (name in OWN and robot in (*arguments[:1], keywords.get("body"))):
                ledger.note(KINDS.get(name, "tampering"), name)
            return call(*arguments, **keywords)

        return counted


class Reader:
    """A view of the ground truth for one purpose; the functions of TRUTH are its attributes.

    Reads are not counted for the module ``owner`` that opened it, and for the simulation that receives it. Reads by
    other modules are counted, and so are readers opened after ``close_truth``.
    """

    def __init__(self, engine: Engine, guarded: GuardedEngine, purpose: ReadPurpose, owner: str) -> None:
        self._engine, self._guarded, self._owner = engine, guarded, owner
        self.purpose = purpose
        self.trusted = not engine.ledger.truth_closed

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in TRUTH:
            raise AttributeError(f"a reader does not offer {name!r}")
        asks: str = sys._getframe(1).f_globals.get("__name__", "")
        free = self.trusted and (asks == self._owner or asks.startswith(SIMULATION))
        read: Callable[..., Any] = getattr(self._engine if free else self._guarded, name)
        return read
