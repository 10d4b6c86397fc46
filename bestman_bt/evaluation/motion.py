"""Writes down where everything was during a simulated run, so that it can be filmed when it has ended."""

from __future__ import annotations

from pathlib import Path

from bestman_bt.messages import Pose
from bestman_bt.visualization import RobotSnapshot
from bestman_bt.visualization.motion_file import MOTION_NAME, MotionWriter
from hal.simulation import SceneRecorder, SceneSnapshot


class MotionLog:
    """Adds a moment to ``motion.jsonl`` in ``folder`` at every ``every``-th tick."""

    def __init__(self, folder: Path, scene: SceneRecorder, every: int = 4) -> None:
        self._writer = MotionWriter(folder / MOTION_NAME)
        self._scene, self._every = scene, every
        self._ticks = 0

    def open(self) -> None:
        """Write the first moment."""
        self._write()

    def close(self) -> None:
        """Write the last moment and end the file."""
        self._write()
        self._writer.close()

    def after_tick(self) -> None:
        """Called by the executor."""
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._write()

    def _write(self) -> None:
        self._writer.write(robot_snapshot(self._scene.scene_snapshot(), self._ticks))


def robot_snapshot(seen: SceneSnapshot, tick: int, believed: Pose | None = None) -> RobotSnapshot:
    """What the simulator has seen, as the recorders take it; ``believed``: map_from_base, as the robot believes."""
    return RobotSnapshot(
        stamp=seen.stamp,
        tick=tick,
        map_from_base=seen.base_pose,
        joint_positions=seen.joint_positions,
        believed_map_from_base=believed,
        body_poses={**seen.object_poses, **seen.leaf_poses, **seen.walker_poses},
    )
