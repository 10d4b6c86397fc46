"""The poses of a moment of a run, and the visual shapes of the scene's bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bestman_bt.messages import PlacedShape, Pose


@dataclass(frozen=True)
class RobotSnapshot:
    """The robot and the movable bodies at ``stamp`` seconds of the robot's clock, during tick number ``tick``.

    ``map_from_base``: the true pose of the base. ``believed_map_from_base``: the believed one, or None.
    ``joint_positions``: joint name → rad or m. ``body_poses``: body name → map_from_body.
    """

    stamp: float
    tick: int
    map_from_base: Pose
    joint_positions: Mapping[str, float]
    believed_map_from_base: Pose | None = None
    body_poses: Mapping[str, Pose] = field(default_factory=dict)


@dataclass(frozen=True)
class RecordedBody:
    """A rigid body of the scene at ``pose`` (map_from_body) at the start of the recording.

    ``colors``: one rgba, each 0 to 1, per shape of ``shapes``; an alpha below 1 is drawn transparent.
    """

    name: str
    shapes: tuple[PlacedShape, ...]
    colors: tuple[tuple[float, float, float, float], ...]
    pose: Pose

    def __post_init__(self) -> None:
        if len(self.colors) != len(self.shapes):
            raise ValueError(
                f"RecordedBody {self.name!r} should have one colour per shape: "
                f"{len(self.shapes)} shapes, {len(self.colors)} colors"
            )
