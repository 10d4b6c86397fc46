"""What Blender is asked to paint: bodies, a robot, where all is in each frame, and from where it is seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bestman_bt.messages import Pose
from bestman_bt.visualization.blender.painted_robot import PaintedRobot
from bestman_bt.visualization.blender.plain_values import placed_document, pose_document
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot

Finish = Literal["wall", "furniture", "object", "person"]
"""What a body is made to look like; colours are the body's own."""


@dataclass(frozen=True)
class PaintedBody:
    """A body of the scene and its finish."""

    body: RecordedBody
    finish: Finish


@dataclass(frozen=True)
class PaintedFrame:
    """``eye``, ``target``: metres, map frame; ``field_of_view``: vertical, degrees. ``file``: the PNG to be written."""

    snapshot: RobotSnapshot
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float
    file: Path


@dataclass(frozen=True)
class PaintJob:
    """``hidden``: bodies that are left out, such as walls before the camera. ``samples``: light paths per pixel."""

    robot: PaintedRobot
    bodies: Sequence[PaintedBody]
    frames: Sequence[PaintedFrame]
    hidden: frozenset[str] = frozenset()
    width: int = 960
    height: int = 720
    samples: int = 32
    seed: int = 0

    def document(self) -> dict[str, Any]:
        """The job as plain values; poses are [x, y, z, qx, qy, qz, qw]."""
        return {
            "width": self.width,
            "height": self.height,
            "samples": self.samples,
            "seed": self.seed,
            "bodies": [_body(painted) for painted in self.bodies if painted.body.name not in self.hidden],
            "hidden": [_body(painted) for painted in self.bodies if painted.body.name in self.hidden],
            "robot": self.robot.document(),
            "frames": [self._frame(frame) for frame in self.frames],
        }

    def _frame(self, frame: PaintedFrame) -> dict[str, Any]:
        snapshot = frame.snapshot
        return {
            "file": str(frame.file),
            "eye": frame.eye,
            "target": frame.target,
            "field_of_view": frame.field_of_view,
            "bodies": _poses(snapshot.body_poses),
            "links": _poses(self.robot.link_poses(snapshot.map_from_base, snapshot.joint_positions)),
        }


def _body(painted: PaintedBody) -> dict[str, Any]:
    body = painted.body
    return {
        "name": body.name,
        "finish": painted.finish,
        "pose": pose_document(body.pose),
        "parts": [placed_document(*part) for part in zip(body.shapes, body.colors, strict=True)],
    }


def _poses(poses: Mapping[str, Pose]) -> dict[str, list[float]]:
    return {name: pose_document(pose) for name, pose in poses.items()}
