"""Evidence and verdicts of judging a run, independent of the backend."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.world_model.world_model import WorldModel

if TYPE_CHECKING:
    from bestman_bt.configuration.run import RunConfig
    from bestman_bt.robot_model.model import RobotModel
    from bestman_bt.scene.scene import World


class Truth(Protocol):
    """Ground truth at the end of a run; poses in the map frame."""

    @property
    def object_names(self) -> tuple[str, ...]:
        """Return the names of the movable objects."""

    def object_pose(self, name: str) -> Pose:
        """Return the pose of an object."""

    def articulation_position(self, name: str) -> float:
        """Return the opening of a door or drawer, radians or metres from closed."""

    def base_pose(self) -> Pose:
        """Return the pose of the robot's base frame."""

    def frame_pose(self, frame: str) -> Pose:
        """Return the pose of a frame of the robot."""

    def touches_robot(self, name: str) -> bool:
        """Return whether the robot presses on an object."""

    def supports(self, name: str) -> tuple[str, ...]:
        """Return the names of the bodies other than the robot that touch an object."""


@dataclass(frozen=True)
class DrawnTask:
    """A task in a generated world. ``world_model``: the robot's initial knowledge.

    ``absent``: objects that the scene does not contain. ``registry``: of the nodes, or None if they could not be loaded
    or are not needed.
    """

    config: RunConfig
    robot_model: RobotModel
    world: World
    world_model: WorldModel
    registry: Any = None
    absent: tuple[str, ...] = field(default=(), kw_only=True)


@dataclass(frozen=True)
class Evidence:
    """The evidence from which facts are judged, after the rest time.

    ``before``: name → position (3,) in the map frame at the beginning of the rest time, of each existing object of the
    task. ``driven``: distance driven by the base, metres. ``tool_frame``: of the arm.
    """

    task: DrawnTask
    truth: Truth
    before: Mapping[str, NDArray[np.float64]]
    driven: float = 0.0
    tool_frame: str = ""


@dataclass(frozen=True)
class Verdict:
    """The judgement of a predicate. ``holds``: whether it is true. ``why``: the reason if not. ``metrics``: measured
    values.
    """

    holds: bool
    why: str = ""
    metrics: dict[str, float] = field(default_factory=dict)

    @staticmethod
    def on(thing: str, faults: Iterable[str], metrics: dict[str, float] | None = None) -> Verdict:
        """Return a verdict: true without ``faults``, else false with a reason such as ``the cup is not released, still
        moving``.
        """
        why = ", ".join(faults)
        return Verdict(not why, f"the {thing} is {why}" if why else "", metrics or {})


def joined(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the conjunction of verdicts, with the reasons of the false ones."""
    found = list(verdicts)
    metrics = {name: value for verdict in found for name, value in verdict.metrics.items()}
    return Verdict(all(v.holds for v in found), "; ".join(v.why for v in found if not v.holds), metrics)
