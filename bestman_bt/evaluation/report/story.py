"""What is known of one run when it is over: the parts of its folder, put together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bestman_bt.evaluation.report.stop_chart import StopChart
from bestman_bt.evaluation.result import RunResult
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.timeline import Activities

INTERRUPTED = "interrupted"
STILL_RUNNING = "running"
LONGEST_SETTING = 200


@dataclass(frozen=True)
class StoryPicture:
    """``jpeg``: small enough to be put into a page; ``caption``: what it shows."""

    caption: str
    jpeg: bytes
    width: int
    height: int


@dataclass(frozen=True)
class StoryFailure:
    """A leaf failed: when (seconds since the start), which, why, how often at that moment, and what the robot saw.

    ``node``: what people call it, its name with file and line, or its path where no file defines it.
    """

    time: float
    node: str
    code: str
    why: str
    count: int = 1
    picture: StoryPicture | None = None


@dataclass(frozen=True, eq=False)
class RunStory:
    """One run.

    ``outcome``: as in ``result.json``, or INTERRUPTED or STILL_RUNNING where there is none. ``started``: seconds since
    the epoch, None if nothing tells. ``duration``: seconds of the robot's clock up to the last thing that is known.
    ``entry``: of a suite, empty of other runs. ``settings``: what else decides the run, as ``--set`` names it → text.
    ``result``: None if the run never came to its end. ``stops``: what its black
    boxes tell. ``notes``: what could not be read, in words. ``source``: the process of others that was watched.
    """

    folder: Path
    task: str
    seed: int
    robot: str
    scene: str
    entry: str
    settings: Mapping[str, str]
    outcome: str
    started: float | None
    duration: float
    result: RunResult | None
    config: str
    nodes: NodeList
    activities: Activities
    failures: tuple[StoryFailure, ...] = ()
    pictures: tuple[StoryPicture, ...] = ()
    stops: tuple[StopChart, ...] = ()
    notes: tuple[str, ...] = field(default=())
    source: str = ""

    @property
    def title(self) -> str:
        """The task, and which of its runs this is."""
        which = self.source if self.source or (self.result is None and not self.config) else f"seed {self.seed}"
        return ", ".join(part for part in (self.task, which) if part)

    @property
    def scene_and_robot_settings(self) -> str:
        """The settings of scene and robot, which a run has only where somebody gave them, in words."""
        return setting_words(self.settings, [key for key in self.settings if key.startswith(("scene.", "robot."))])

    @property
    def is_counted(self) -> bool:
        """Whether it came to an end of its own, so that it counts in a rate of success."""
        return self.result is not None and self.outcome != "cancelled"


def setting_words(settings: Mapping[str, str], keys: Iterable[str]) -> str:
    """``key=value, …`` of those of ``keys`` that are set, in their order, each shortened to what can be read."""
    return ", ".join(f"{key}={settings[key]}"[:LONGEST_SETTING] for key in keys if key in settings)
