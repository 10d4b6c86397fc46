"""The data of a finished run for rendering: world, robot and motion."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path

from bestman_bt.configuration.run import RunConfig, read_run
from bestman_bt.engine import RUNNING
from bestman_bt.errors import InputError
from bestman_bt.facts.evidence import DrawnTask
from bestman_bt.facts.goals.goal import goals_of
from bestman_bt.records.reader import RecordError, has_record, read
from bestman_bt.records.writer import CONFIG_FILE
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import World
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.motion_file import MOTION_NAME, MotionRecord, read_motion
from bestman_bt.world_model.world_model import WorldModel


class FilmError(InputError):
    """A film or still cannot be made."""


@dataclass(frozen=True, eq=False)
class FilmedRun:
    """A run to render. ``subjects``: objects, doors and drawers of the task. ``doings``: start time (s) and leaf."""

    config: RunConfig
    robot_model: RobotModel
    world: World
    motion: MotionRecord
    subjects: tuple[str, ...]
    doings: tuple[tuple[float, str], ...]

    def doing(self, time: float) -> str:
        """Return the type of the leaf that ran at ``time``, seconds; empty if none ran."""
        index = bisect_right(self.doings, time, key=lambda doing: doing[0]) - 1
        return self.doings[index][1] if index >= 0 else ""


def read_filmed_run(folder: Path) -> FilmedRun:
    """Read the folder of a simulated run; the scene is regenerated from its seed.

    Raises FilmError, ConfigurationError or SceneError.
    """
    if not (folder / CONFIG_FILE).is_file():
        raise FilmError(f"{folder} is not a run folder: it has no config.yaml")
    if not (folder / MOTION_NAME).is_file():
        raise FilmError(f"{folder} has no {MOTION_NAME}: only simulated runs write one, and older versions did not")
    config = read_run(folder / CONFIG_FILE)
    try:
        motion = read_motion(folder / MOTION_NAME)
    except RecordingError as error:
        raise FilmError(str(error)) from error
    robot_model = load_robot_model(config.task.robot, config.robot_settings)
    scene = load_scene(config.task.scene, config.scene_settings)
    world = draw_world(scene, config.seed)
    doors = [f"{piece.name}/{door.name}" for piece in world.furniture for door in piece.model.articulations]
    there = {thing.name for thing in world.objects} | set(doors) | {walker.name for walker in world.walkers}
    if there != set(motion.bodies):
        changed = ", ".join(sorted(there ^ set(motion.bodies)))
        raise FilmError(f"the scene {config.task.scene!r} has changed since the run: {changed}")
    task = DrawnTask(config, robot_model, world, WorldModel(semantic_map(world), dict(scene.models)))
    subjects = [name for goal in goals_of(task) for name in goal.subjects()]
    return FilmedRun(config, robot_model, world, motion, tuple(subjects), _doings(folder))


def _doings(folder: Path) -> tuple[tuple[float, str], ...]:
    """Return which leaf ran from which time on; of several running ones the last in the tree."""
    if not has_record(folder):
        return ()
    try:
        history = read(folder, ("blackboard", "map", "path", "robot", "scan"))
    except RecordError as error:
        raise FilmError(f"the running leaves cannot be determined: {error}") from error
    leaves = {node.uid: node.type for node in history.nodes if node.is_leaf}
    running: set[int] = set()
    found = [(0.0, "")]
    for change in history.states.changes():
        if change.uid in leaves:
            (running.add if change.status == RUNNING else running.discard)(change.uid)
            found.append((change.time, leaves[max(running)] if running else ""))
    return tuple(found)
