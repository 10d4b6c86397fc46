"""Durations of driving, arm motion, perception and planning: simulated time of running leaves, by family."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from bestman_bt.engine import RUNNING, Node, Tree
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.visualization.motion_file import MOTION_NAME, MotionWriter
from bestman_bt.visualization.snapshot import RobotSnapshot
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.scene_recorder import SceneRecorder, SceneSnapshot


class DrivenPath:
    """Sums the distance of the true base pose from tick to tick, without turns in place."""

    def __init__(self, truth: GroundTruth) -> None:
        self._truth = truth
        self._before: Pose2D | None = None
        self.length = 0.0
        """Metres."""

    def after_tick(self) -> None:
        """Add the motion since the last tick."""
        pose = self._truth.base_pose().to_pose2d()
        if self._before is not None:
            self.length += pose.distance_to(self._before)
        self._before = pose


class MotionLog:
    """Adds a moment to ``motion.jsonl`` in ``folder`` at every ``every``-th tick, as long as the file can be
    written.
    """

    def __init__(
        self, folder: Path, scene: SceneRecorder, every: int = 4, keeping: RecordingErrors | None = None
    ) -> None:
        self._keeping = keeping or RecordingErrors()
        self._writer = MotionWriter(folder / MOTION_NAME)
        self._scene, self._every = scene, every
        self._ticks = 0

    def open(self) -> None:
        """Write the first moment."""
        self._write()

    def close(self) -> None:
        """Write the last moment and end the file."""
        self._write()
        with suppress(OSError):  # of what could not be written before
            self._writer.close()

    def after_tick(self) -> None:
        """Called by the executor."""
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._write()

    def _write(self) -> None:
        snapshot = robot_snapshot(self._scene.scene_snapshot(), self._ticks)
        self._keeping.write(MOTION_NAME, lambda: self._writer.write(snapshot))


def robot_snapshot(seen: SceneSnapshot, tick: int, believed: Pose | None = None) -> RobotSnapshot:
    """Return the simulator's snapshot for the recorders; ``believed``: map_from_base, as believed by the robot."""
    return RobotSnapshot(
        stamp=seen.stamp,
        tick=tick,
        map_from_base=seen.base_pose,
        joint_positions=seen.joint_positions,
        believed_map_from_base=believed,
        body_poses={**seen.object_poses, **seen.articulation_poses, **seen.walker_poses},
    )


FAMILIES = {
    "drive_s": ("navigation.navigate", "navigation.explore", "navigation.localise", "nav2"),
    "arm_s": (
        *("manipulation.move_arm", "manipulation.grasp", "manipulation.place", "manipulation.place_in"),
        *("manipulation.push", "manipulation.policy", "furniture.open", "furniture.close"),
    ),
    "perception_s": (
        *("perception.perceive", "perception.scan", "perception.look", "manipulation.next_best_view"),
        "furniture.handles",
    ),
    "planning_s": ("manipulation.base_placement", "furniture.base_placement", "perception.tidying"),
}
"""Duration → modules and folders of ``behaviours`` whose leaves it sums."""
_OTHER_FAMILY = {
    "PlanGrasp": "planning_s",
    "FindPlacePose": "planning_s",
    "FindPushStand": "planning_s",
    "ComputePathToPose": "planning_s",
    "ComputePathThroughPoses": "planning_s",
    "CheckHeld": "perception_s",
    **dict.fromkeys(("FindRoomIn", "BelieveBlocked", "ForgetBlocked", "BelievedSurface", "ObjectVisible", "ObjectAt")),
    "Wait": None,
}
"""Leaves of a different family than their module."""


def duration_of(leaf: type[Node]) -> str | None:
    """Return the duration family of a leaf or of its shipped base class, or None."""
    for base in leaf.__mro__:
        folder, _, rest = base.__module__.partition(".")
        if folder == "behaviours":
            within = {rest, rest.partition(".")[0]}
            family = next((name for name, modules in FAMILIES.items() if within & set(modules)), None)
            return _OTHER_FAMILY.get(base.__name__, family)
    return None


class Durations:
    """Sums, over the ticks, the time in which at least one leaf of a family is running, also in inner trees."""

    def __init__(self, tree: Tree) -> None:
        self._clock = tree.clock
        self._before = self._clock.now()
        self._leaves: dict[str, list[Node]] = {}
        self._running: list[str] = []
        self._seconds: dict[str, float] = {}
        self._add(tree)
        tree.subscribe_to_inner(self._add)

    @property
    def seconds(self) -> dict[str, float]:
        """Return the seconds of each family that the tree has leaves of."""
        return {name: round(self._seconds[name], 3) for name in FAMILIES if name in self._seconds}

    def after_tick(self) -> None:
        """Add the time since the last tick to the families that were running."""
        now = self._clock.now()
        for name in self._running:
            self._seconds[name] += now - self._before
        self._before = now
        self._running = [name for name, leaves in self._leaves.items() if any(leaf.state == RUNNING for leaf in leaves)]

    def _add(self, tree: Tree, under: Node | None = None) -> None:
        for node in tree.nodes:
            name = duration_of(type(node)) if not node.children else None
            if name is not None:
                self._leaves.setdefault(name, []).append(node)
                self._seconds.setdefault(name, 0.0)
