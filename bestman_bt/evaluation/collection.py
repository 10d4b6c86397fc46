"""Datasets of judged successes: what the robot measured, was commanded and saw in each frame of a task's episodes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig
from bestman_bt.engine import RUNNING, Tree
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.evaluation.result import RunResult
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat, DatasetWriter
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import Camera, Gripper, JointGroup, MobileBase, Part
from hal.parts.black_box import Trace
from hal.parts.channels import ControlledPart

STATE, ACTION, NODE = "observation.state", "action", "node"
ATTEMPTS = "attempts.jsonl"
"""The file of a dataset with a line for each seed that was tried, failures too."""


@dataclass(frozen=True)
class RecordedPart:
    """A part whose quantities are entries of state and action: joint positions, a gripper's width, base velocities.

    ``entries``: names in a dataset, those of the part and of the quantity: ``arm/panda_joint1``, ``gripper/width``,
    ``base/vx``; rad, m, m/s, rad/s. ``columns``: of the commanded values in the part's trace.
    """

    name: str
    entries: tuple[str, ...]
    columns: tuple[int, ...]

    @classmethod
    def of(cls, part: Part) -> RecordedPart | None:
        """Return what is recorded of a part, None if it is not actuated or keeps no trace."""
        if isinstance(part, JointGroup):
            quantities = {joint: f"set position {joint}" for joint in part.joint_names}
        elif isinstance(part, Gripper):
            quantities = {"width": "set width"}
        elif isinstance(part, MobileBase):
            quantities = {axis: f"set {axis}" for axis in ("vx", "vy", "wz")}
        else:
            return None
        traced = part.traced if isinstance(part, ControlledPart) else ()
        if not set(quantities.values()) <= set(traced):
            return None
        entries = tuple(f"{part.name}/{quantity}" for quantity in quantities)
        return cls(part.name, entries, tuple(map(traced.index, quantities.values())))


def _trace(part: Part) -> Trace:
    assert isinstance(part, ControlledPart)
    assert part.trace is not None
    return part.trace


def _measured(part: Part) -> Iterable[float]:
    if isinstance(part, JointGroup):
        return map(float, part.positions())
    if isinstance(part, Gripper):
        return (part.width(),)
    assert isinstance(part, MobileBase)
    return astuple(part.velocity())


class FrameRecorder:
    """Takes a frame after each tick: what was measured, seen and running then, and the set-points one tick later."""

    def __init__(self, writer: DatasetWriter, parts: Sequence[RecordedPart]) -> None:
        self._writer, self._parts = writer, parts
        self._pending: tuple[list[float], str, dict[str, NDArray[Any]]] | None = None

    def watch(self, session: RobotSession, tree: Tree) -> Callable[[], None]:
        """Return the hook of ``run_episode``."""
        leaves, parts = [node for node in tree.nodes if not node.children], session.robot.parts
        traces = [_trace(parts[one.name]) for one in self._parts]

        def after_tick() -> None:
            rows = [row for trace in traces if (row := trace.latest()) is not None]
            if len(rows) < len(traces):
                return  # before the first control period
            pairs = zip(self._parts, rows, strict=True)
            self.end([float(row[column]) for one, row in pairs for column in one.columns])
            measured = [value for one in self._parts for value in _measured(parts[one.name])]
            running = ", ".join(leaf.path for leaf in leaves if leaf.state == RUNNING)
            self._pending = measured, running, _pictures(parts, self._writer.frames.cameras)

        return after_tick

    def end(self, commanded: Sequence[float] | None = None) -> None:
        """Write the frame that waits for its action; the last one of an episode holds what was measured."""
        if self._pending is not None:
            measured, node, pictures = self._pending
            self._writer.add_frame({STATE: measured, ACTION: commanded or measured, NODE: node}, pictures)
        self._pending = None


def _pictures(parts: Mapping[str, Part], cameras: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    found = {}
    for name in cameras:
        part = parts[name]
        assert isinstance(part, Camera)
        found[name] = part.capture().rgb
    return found


class Collection:
    """A dataset in ``folder`` that grows by judged successes of a simulated task; what it holds already counts.

    ``words``: the language instruction of its episodes. ``cameras``: names of the robot's cameras. Raises
    ConfigurationError, DatasetError, MissingExtraError.
    """

    def __init__(self, config: RunConfig, folder: Path, words: str, cameras: Sequence[str]) -> None:
        setup = prepare_episode(config)
        task, model = config.task, setup.robot_model
        problems = []
        if not (task.predicates or task.goals):
            problems.append(config.problem((), "has no goals: its episodes are not judged"))
        if task.tick_rate != int(task.tick_rate):
            problems.append(config.problem(("tick_rate",), f"should be whole for a dataset, got {task.tick_rate:g} Hz"))
        lenses = {name: camera.intrinsics for name, camera in model.of(CameraPart).items()}
        for name in cameras:
            if name not in lenses:
                why = f"{name!r} is not a camera of {model.name}, which has {', '.join(lenses) or 'none'}"
                problems.append(Problem("--camera", None, "", why))
        if problems:
            raise ConfigurationError(problems)
        self.folder, self._config, self._words = folder, config, words
        parts = DRIVERS.resolve(config.driver)(model, setup.world, seed=config.seed).parts  # not connected
        self._parts = [one for one in map(RecordedPart.of, parts.values()) if one is not None]
        names = tuple(name for one in self._parts for name in one.entries)
        sizes = {name: (lenses[name].height, lenses[name].width) for name in cameras}
        frames = DatasetFormat(int(task.tick_rate), {STATE: names, ACTION: names}, (NODE,), sizes, model.name)
        self._writer = DatasetWriter(folder, frames, resume=True)

    @property
    def kept(self) -> int:
        """Return the number of this task's episodes in the dataset."""
        return sum(episode["tasks"] == [self._words] for episode in self._writer.episodes)

    def collect(self, episodes: int, most: int, show: Callable[[RunResult], None]) -> None:
        """Run seeds from the first one until the dataset has ``episodes`` of this task, at most ``most`` seeds.

        Seeds that were tried in an earlier call are passed over. ``show``: receives each result.
        """
        tried = self._tried()
        for seed in range(self._config.seed, self._config.seed + most):
            if self.kept >= episodes:
                return
            if seed not in tried:
                show(self._attempt(seed))

    def _attempt(self, seed: int) -> RunResult:
        recorder = FrameRecorder(self._writer, self._parts)
        try:
            result = run_episode(self._config.changed(seed=seed), watch=recorder.watch)
            recorder.end()
            kept = result.success and not result.unearned
            index = self._writer.end_episode(self._words, seed=seed) if kept else None
        finally:
            self._writer.discard()
        why = result.failure.why if result.failure is not None else result.unearned
        line = {
            "task": self._words,
            "seed": seed,
            "episode": index,
            "outcome": str(result.outcome),
            "why": why,
            "versions": result.versions,
        }
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ATTEMPTS).open("a", encoding="utf-8") as attempts:
            attempts.write(json.dumps(line) + "\n")
        return result

    def _tried(self) -> set[int]:
        """Return the seeds that have ended: a process that is killed between its two files has kept its episode."""
        try:
            lines = (self.folder / ATTEMPTS).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            lines = []
        ended = [(line["tasks"][0], line["seed"]) for line in self._writer.episodes]
        ended += [(line["task"], line["seed"]) for line in map(json.loads, lines)]
        return {seed for task, seed in ended if task == self._words}
