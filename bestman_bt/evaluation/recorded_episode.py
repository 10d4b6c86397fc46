"""Episodes recorded frame by frame while they run: measurements, commands and images."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from behaviours.failure import NodeFailure
from bestman_bt.configuration.run import dump_run
from bestman_bt.engine import RUNNING, Node, Tree
from bestman_bt.engine.bounds import Named
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.manipulation.policy.training.lerobot_dataset import SUBTASK, DatasetFormat, DatasetWriter
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import Camera, Gripper, JointGroup, MobileBase, Part
from hal.parts.black_box import Trace
from hal.parts.channels import ControlledPart

STATE, ACTION, NODE = "observation.state", "action", "node"
RUN, AUDIT = "run", "audit"
"""The columns of an episode's row with its configuration, YAML, and the counters of the audit, JSON."""
LABELS = ("outcome", "error_code", "failed_node", "why")
"""The columns of a failed episode's row, and entries of each attempt: see ``labels``."""


@dataclass(frozen=True)
class RecordedPart:
    """A part whose quantities are entries of state and action: joint positions, a gripper's width, base velocities.

    ``entries``: names in a dataset, those of the part and of the quantity: ``arm/panda_joint1``, ``gripper/width``,
    ``base/vx``. ``units``: of each, rad, m, m/s or rad/s. ``columns``: of the commanded values in the part's trace.
    """

    name: str
    entries: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[int, ...]

    @classmethod
    def of(cls, part: Part, sliding: Collection[str]) -> RecordedPart | None:
        """Return the recorded quantities of a part, or None if it is not actuated or has no trace; ``sliding``:
        prismatic joints.
        """
        if isinstance(part, JointGroup):
            quantities = {joint: f"set position {joint}" for joint in part.joint_names}
            units = tuple("m" if joint in sliding else "rad" for joint in part.joint_names)
        elif isinstance(part, Gripper):
            quantities, units = {"width": "set width"}, ("m",)
        elif isinstance(part, MobileBase):
            quantities, units = {axis: f"set {axis}" for axis in ("vx", "vy", "wz")}, ("m/s", "m/s", "rad/s")
        else:
            return None
        traced = part.traced if isinstance(part, ControlledPart) else ()
        if not set(quantities.values()) <= set(traced):
            return None
        entries = tuple(f"{part.name}/{quantity}" for quantity in quantities)
        return cls(part.name, entries, units, tuple(map(traced.index, quantities.values())))


def _trace(part: Part) -> Trace:
    assert isinstance(part, ControlledPart)
    assert part.trace is not None
    return part.trace


def measured(part: Part) -> Iterable[float]:
    """Return the entries of the state that belong to a recorded part."""
    if isinstance(part, JointGroup):
        return map(float, part.positions())
    if isinstance(part, Gripper):
        return (part.width(),)
    assert isinstance(part, MobileBase)
    return astuple(part.velocity())


def leaf_words(leaf: Node) -> str:
    """Return a running leaf as text: its type and object ports, such as ``grasp (object cup)``."""
    kind = re.sub(r"(?<!^)(?=[A-Z][a-z])", " ", leaf.type_id).lower()
    ports = [name for name, port in leaf.INPUT_PORTS.items() if any(map(_is_name, getattr(port, "bounds", ())))]
    named = ", ".join(f"{port} {value}" for port in ports if (value := leaf.get_input(port)))
    return f"{kind} ({named})" if named else kind


def _is_name(bound: object) -> bool:
    return isinstance(bound, Named)


def labels(result: RunResult) -> dict[str, str]:
    """Return the outcome and, for a failure, its code, the leaf's path (or ``judge``, ``audit``) and the reason."""
    failure = result.failure or NodeFailure("", "", result.unearned)
    values = str(result.outcome), failure.error_code, failure.node, failure.why
    return dict(zip(LABELS, values, strict=True))


def is_kept(result: RunResult, failures: bool) -> bool:
    """Return whether to keep the frames of an episode: those of a judged success and, with ``failures``, of a
    failure.
    """
    return not result.unearned if result.success else failures and result.outcome is Outcome.FAILURE


class FrameRecorder:
    """Records a frame after each tick: measurements, images and running leaves, and the set-points one tick later."""

    def __init__(self, writer: DatasetWriter, parts: Sequence[RecordedPart]) -> None:
        self._writer, self._parts = writer, parts
        self._pending: tuple[dict[str, Any], dict[str, NDArray[Any]]] | None = None

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
            state = [value for one in self._parts for value in measured(parts[one.name])]
            running = [leaf for leaf in leaves if leaf.state == RUNNING]
            values = {
                STATE: state,
                NODE: ", ".join(leaf.path for leaf in running),
                SUBTASK: " and ".join(map(leaf_words, running)) if self._writer.frames.subtasks else "",
            }
            self._pending = values, _pictures(parts, self._writer.frames.cameras)

        return after_tick

    def end(self, commanded: Sequence[float] | None = None) -> None:
        """Write the frame that waits for its action; the action of an episode's last frame is the measured state."""
        if self._pending is not None:
            values, pictures = self._pending
            self._writer.add_frame({**values, ACTION: commanded or values[STATE]}, pictures)
        self._pending = None


def _pictures(parts: Mapping[str, Part], cameras: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    found = {}
    for name in cameras:
        part = parts[name]
        assert isinstance(part, Camera)
        found[name] = part.capture().rgb
    return found


@dataclass(frozen=True)
class RecordedEpisode(EpisodeRequest):
    """An episode that writes a dataset with this one episode, if it is a judged success or, with ``failures``, failed.

    ``staged``: folder for the dataset, named by the seed; every machine sees it at this path. ``frames``, ``parts``:
    the content of each frame. ``words``: the language instruction.
    """

    staged: Path = field(kw_only=True)
    frames: DatasetFormat = field(kw_only=True)
    parts: tuple[RecordedPart, ...] = field(kw_only=True)
    words: str = field(kw_only=True)
    failures: bool = field(kw_only=True)

    @property
    def written(self) -> Path | None:
        """Return the folder of the datasets."""
        return self.staged

    def run_prepared(self, setup: ResolvedConfig, run_folder: Path | None) -> RunResult:
        """Run the episode; its dataset appears only when complete, even if two workers run the same episode."""
        folder = Path(tempfile.mkdtemp(prefix="recording-", dir=self.staged))
        try:
            writer = DatasetWriter(folder / "dataset", self.frames)
            recorder = FrameRecorder(writer, self.parts)
            try:
                result = run_episode(setup, run_folder, watch=recorder.watch)
                recorder.end()
                if is_kept(result, self.failures):
                    about = {
                        RUN: dump_run(self.config, absolute=True),
                        AUDIT: json.dumps(result.to_document()["audit"]),
                        **({} if result.success else labels(result)),
                    }
                    writer.end_episode(self.words, seed=self.config.seed, **about)
                    finished = self.staged / str(self.config.seed)
                    try:
                        (folder / "dataset").rename(finished)
                    except OSError:
                        if not finished.is_dir():  # another worker has run the same episode
                            raise
            finally:
                writer.discard()
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        return result
