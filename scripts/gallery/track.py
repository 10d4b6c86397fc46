"""What happened in a run: where everything was at each tick, to be filmed afterwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bestman_bt.configuration import load_run
from bestman_bt.engine import RUNNING, Tree
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.evaluation.result import RunResult
from bestman_bt.runtime import Session, Setup
from hal.api import Robot
from hal.pybullet import GroundTruth, PyBulletRobot, SceneRecorder, SceneSnapshot


@dataclass(frozen=True)
class Moment:
    """``snapshot`` of the scene; ``openings``: doors and drawers, radians or metres; ``doing``: the leaf that runs."""

    snapshot: SceneSnapshot
    openings: Mapping[str, float]
    doing: str


@dataclass(frozen=True)
class Track:
    """One judged run: a moment per tick."""

    setup: Setup
    result: RunResult
    moments: tuple[Moment, ...]

    @property
    def duration(self) -> float:
        """Simulated seconds."""
        return self.moments[-1].snapshot.stamp - self.moments[0].snapshot.stamp


def record(task: str, seed: int) -> Track:
    """Run a task once; nothing is drawn meanwhile, so that the run is the same as without a film."""
    setup = prepare_episode(load_run(task, seed=seed))
    views: list[tuple[SceneRecorder, GroundTruth]] = []
    moments: list[Moment] = []

    def prepare_robot(robot: Robot) -> None:
        assert isinstance(robot, PyBulletRobot)
        views.append((SceneRecorder(robot), GroundTruth(robot)))

    def watch(session: Session, tree: Tree) -> Callable[[], None]:
        ((scene, truth),) = views

        def look() -> None:
            openings = {name: truth.articulation_position(name) for name in truth.articulation_names}
            moments.append(Moment(scene.scene_snapshot(), openings, running_leaf(tree)))

        look()
        return look

    result = run_episode(setup, watch=watch, prepare_robot=prepare_robot)
    return Track(setup, result, tuple(moments))


def running_leaf(tree: Tree) -> str:
    """The class of the leaf that runs now, or nothing."""
    leaves = [node for node in tree.nodes if not node.children and node.state == RUNNING]
    return type(leaves[-1]).__name__ if leaves else ""
