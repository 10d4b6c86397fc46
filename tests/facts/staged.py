"""Runs whose end is staged: a tree that does nothing, and doors and things put where a test wants them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.result import RunResult
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession

NOTHING = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
AS_MAPPED = {"offset": 0, "turn": 0}


@dataclass(frozen=True)
class Staged:
    """What is true at the end. ``opened``: door or drawer → position. ``moved``: name → pose in the map frame, or what
    gives it when it is told the session."""

    opened: Mapping[str, float] = field(default_factory=dict)
    moved: Mapping[str, Pose | Callable[[RobotSession], Pose]] = field(default_factory=dict)

    def __call__(self, session: RobotSession, tree: Tree) -> Callable[[], None]:
        """Called before the first tick."""
        simulation = session.robot.simulation  # type: ignore[attr-defined]
        engine, built = simulation.engine, simulation.built
        for name, position in self.opened.items():
            engine.set_joint(*built.articulations[name], position)
        for name, where in self.moved.items():
            pose = where if isinstance(where, Pose) else where(session)
            engine.put(built.objects[name], pose.position.tolist(), pose.quaternion.tolist())
        return lambda: None


def judged(folder: Path, task: Mapping[str, object], end: Staged, seed: int = 1) -> RunResult:
    """The result of a run of ``task`` whose end is staged; it is no honest one, but it is judged like any other."""
    (folder / "nothing.xml").write_text(NOTHING)
    path = folder / "staged.yaml"
    path.write_text(yaml.safe_dump({"tree": str(folder / "nothing.xml"), "robot": "diff_panda", **task}))
    return run_episode(load_run(path, seed=seed), watch=end)


def why(result: RunResult) -> str:
    """What the judge says is wrong."""
    assert result.predicate is False
    assert result.failure is not None
    staged = result.failure.node == "audit"  # what a test moves on its own is faked, and comes first
    assert staged or result.failure.node == "judge"
    return result.failure.why.rpartition("besides, ")[2] if staged else result.failure.why
