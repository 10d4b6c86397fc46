"""Failures of nodes, as in logs, reports and ``result.json``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from bestman_bt.messages import MotionObstacle


@dataclass(frozen=True)
class NodeFailure:
    """The failure of a leaf. ``node``: its path in the tree, ``where``: its name with file and line. ``why``: the
    reason as text.

    ``stamp``: seconds on the robot's clock. ``part`` and ``vendor_code``: as in ``messages.Failure``. ``error_code``:
    empty if the leaf gives none. ``obstacle``: the cause of a failed motion, if known.
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
        """The node's name with file and line, or its path without a file."""
        return self.where or self.node


READING_FAILS: Mapping[str, str] = {
    "disconnected": "the connection is lost: ClearStop reconnects it",
    "no_data": "a sensor is silent or switched off: check it",
}
"""Failure codes of readings of the robot, each with advice for the tree."""

MOTION_FAILS: Mapping[str, str] = {
    **READING_FAILS,
    "stopped": "the robot was stopped: ClearStop, then look again",
    "superseded": "two branches commanded the same part: let one wait for the other",
    "canceled": "the tree halted it; nothing is wrong",
    "refused": "beyond a limit: correct the tree",
    "declined": "a person declined this motion: try another one, or none",
    "tracking": "a part did not follow, it may be blocked: Retreat or BackUp, then retry",
    "blocked": "an obstacle blocks the path: BackUp, ClearEntireCostmap, then retry",
    "lost": "the base pose is too uncertain: Relocalise",
    "tolerance": "it stopped beside the goal: retry",
    "unreachable": "the target is beyond the part's limits: stand elsewhere, by FindStandPose and NavigateTo",
    "guarded": "a condition of the motion was violated, such as the grip: CheckHeld",
    "other_arm_in_the_way": "another arm blocks the motion: move it away, or let one arm wait for the other",
    "timeout": "it took too long: retry, or allow more time",
    "collision": "a collision, or a protective stop: have it released, ClearStop, Retreat, then look again",
    "fault": "the part has a fault: see the message and the vendor's code",
}
"""Failure codes of motions: those of ``messages.MotionErrorCode``."""

SEEING_FAILS: Mapping[str, str] = {
    "camera_no_image": "the camera delivers no image: retry, else check it",
    "camera_black": "the picture is black: light, or a cover on the lens",
    "camera_no_depth": "nothing in sight has a depth: LookAt from elsewhere",
    "camera_stale": "the images are too old: retry",
}
"""Failure codes of taking an image."""


def declared_failures(leaf: type) -> dict[str, str]:
    """Return code → advice for the tree, for a leaf and its base classes, most derived first."""
    return _declared(leaf.__mro__)


def own_failures(leaf: type) -> dict[str, str]:
    """Return the declared failures without those common to all skills."""
    return _declared(cls for cls in leaf.__mro__ if cls.__module__ != "behaviours.skill")


def _declared(classes: Iterable[type]) -> dict[str, str]:
    declared: dict[str, str] = {}
    for cls in classes:
        for code, advice in vars(cls).get("FAILS", {}).items():
            declared.setdefault(code, advice)
    return declared
