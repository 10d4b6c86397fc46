"""What a run is judged by, whatever it ran on, and what a judgement says."""

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
    """What is true at the end of a run; poses in the map frame."""

    @property
    def object_names(self) -> tuple[str, ...]:
        """The movable objects."""

    def object_pose(self, name: str) -> Pose:
        """Of an object."""

    def articulation_position(self, name: str) -> float:
        """Return how far a door or drawer is open, radians or metres from closed."""

    def base_pose(self) -> Pose:
        """Of the robot's base frame."""

    def frame_pose(self, frame: str) -> Pose:
        """Of a frame of the robot."""

    def touches_robot(self, name: str) -> bool:
        """Return whether the robot presses on an object."""

    def supports(self, name: str) -> tuple[str, ...]:
        """Names of the bodies other than the robot that an object touches."""


@dataclass(frozen=True)
class DrawnTask:
    """A task in the world that the seed has drawn. ``world_model``: what the robot is given of it at the start.

    ``absent``: objects that the scene leaves out. ``registry``: of the nodes that there are, or None if they could not
    be loaded, or nobody asks.
    """

    config: RunConfig
    robot_model: RobotModel
    world: World
    world_model: WorldModel
    registry: Any = None
    absent: tuple[str, ...] = field(default=(), kw_only=True)


@dataclass(frozen=True)
class Evidence:
    """What a fact is judged by, after the rest time.

    ``before``: name → position at the beginning of the rest, of each object that the task names and that is there.
    ``driven``: metres that the base has driven. ``tool_frame``: of the arm that skills move.
    """

    task: DrawnTask
    truth: Truth
    before: Mapping[str, NDArray[np.float64]]
    driven: float = 0.0
    tool_frame: str = ""


@dataclass(frozen=True)
class Verdict:
    """``holds``: whether it is true. ``why``: in words where it is not. ``metrics``: what was measured."""

    holds: bool
    why: str = ""
    metrics: dict[str, float] = field(default_factory=dict)

    @staticmethod
    def on(thing: str, faults: Iterable[str], metrics: dict[str, float] | None = None) -> Verdict:
        """True where there are no faults; else ``the cup is not let go, still moving``."""
        why = ", ".join(faults)
        return Verdict(not why, f"the {thing} is {why}" if why else "", metrics or {})


def joined(verdicts: Iterable[Verdict]) -> Verdict:
    """Return all of them hold, or what is wrong with any."""
    told = list(verdicts)
    metrics = {name: value for verdict in told for name, value in verdict.metrics.items()}
    return Verdict(all(v.holds for v in told), "; ".join(v.why for v in told if not v.holds), metrics)
