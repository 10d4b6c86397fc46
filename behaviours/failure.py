"""Why a node failed, as logs, reports and ``result.json`` tell it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from bestman_bt.messages import MotionObstacle


@dataclass(frozen=True)
class NodeFailure:
    """``node``: its path in the tree, ``where``: its name with file and line. ``why``: in words.

    ``stamp``: seconds on the robot's clock. ``part`` and ``vendor_code``: as of ``messages.Failure``. ``error_code`` is
    empty for a leaf that tells none. ``obstacle``: what a motion failed at, where that is known.
    """

    node: str
    error_code: str
    why: str
    where: str = ""
    stamp: float = 0.0
    part: str = ""
    vendor_code: str = ""
    obstacle: MotionObstacle | None = None

    @property
    def named(self) -> str:
        """What people call the node; its path where no file defines it."""
        return self.where or self.node


READING_FAILS: Mapping[str, str] = {
    "disconnected": "the controller is gone: ClearStop connects it again",
    "no_data": "a sensor is silent or switched off: see that it runs",
}
"""Failure codes of whatever reads the robot, each with what a tree may try then."""

MOTION_FAILS: Mapping[str, str] = {
    **READING_FAILS,
    "stopped": "the robot was stopped: ClearStop, then look again",
    "superseded": "two branches commanded the same part: let one wait for the other",
    "canceled": "the tree halted it; nothing is wrong",
    "refused": "beyond a limit, or the robot is stopped: ClearStop, else correct the tree",
    "declined": "a person who was asked did not want this motion: another way, or none",
    "tracking": "a part did not follow, something may hold it: Retreat or BackUp, then again",
    "blocked": "something is in the way: BackUp, ClearEntireCostmap, then again",
    "lost": "where the base is is not known well enough: Relocalise",
    "tolerance": "it came to rest beside the goal: again",
    "unreachable": "the target is beyond the part's limits: stand elsewhere, by FindStandPose and NavigateTo",
    "guarded": "what had to hold on the way no longer does, such as the grip: CheckHeld",
    "other_arm_in_the_way": "another arm is in the way: move that away, or let one arm wait for the other",
    "timeout": "it took too long: again, or with more time",
    "collision": "a collision, or a protective stop: somebody releases it, ClearStop, Retreat, then look again",
    "fault": "the part is broken: the message has its words, the vendor's code its number",
}
"""Those of whatever moves: the codes of ``messages.MotionErrorCode``."""

SEEING_FAILS: Mapping[str, str] = {
    "camera_no_image": "the camera delivers nothing: again, else see that it runs",
    "camera_black": "the picture is black: light, or a cover on the lens",
    "camera_no_depth": "nothing in sight has a depth: LookAt from elsewhere",
    "camera_stale": "the pictures are too old: again",
}
"""Those of whatever takes a picture."""


def declared_failures(leaf: type) -> dict[str, str]:
    """Code → what a tree may try then: of the leaf and of what it derives from, the more special one first."""
    return _declared(leaf.__mro__)


def own_failures(leaf: type) -> dict[str, str]:
    """Those that not every skill has."""
    return _declared(cls for cls in leaf.__mro__ if cls.__module__ != "behaviours.skill")


def _declared(classes: Iterable[type]) -> dict[str, str]:
    declared: dict[str, str] = {}
    for cls in classes:
        for code, advice in vars(cls).get("FAILS", {}).items():
            declared.setdefault(code, advice)
    return declared
