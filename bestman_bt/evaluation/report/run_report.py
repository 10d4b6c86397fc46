"""The data of a finished run for its report, combined from the files of its folder."""

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
class ReportPicture:
    """``jpeg``: small enough for a page; ``caption``: its description."""

    caption: str
    jpeg: bytes
    width: int
    height: int


@dataclass(frozen=True)
class ReportFailure:
    """The failure of a leaf: time (seconds since the start), node, reason, repetitions, and a picture.

    ``node``: its name with file and line, or its path without a file.
    """

    time: float
    node: str
    code: str
    why: str
    count: int = 1
    picture: ReportPicture | None = None


@dataclass(frozen=True, eq=False)
class RunReport:
    """One run.

    ``outcome``: as in ``result.json``, or INTERRUPTED or STILL_RUNNING without one. ``started``: seconds since the
    epoch, None if unknown. ``duration``: seconds of the robot's clock up to the last known event. ``entry``: of a
    suite, or empty. ``settings``: further settings as for ``--set`` → text. ``result``: None if the run did not finish.
    ``stops``: black boxes. ``notes``: what could not be read, in words. ``source``: the external process that was
    watched.
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
    failures: tuple[ReportFailure, ...] = ()
    pictures: tuple[ReportPicture, ...] = ()
    stops: tuple[StopChart, ...] = ()
    notes: tuple[str, ...] = field(default=())
    source: str = ""

    @property
    def title(self) -> str:
        """The task, with seed or source."""
        which = self.source if self.source or (self.result is None and not self.config) else f"seed {self.seed}"
        return ", ".join(part for part in (self.task, which) if part)

    @property
    def scene_and_robot_settings(self) -> str:
        """The explicit settings of scene and robot, in words."""
        return setting_words(self.settings, [key for key in self.settings if key.startswith(("scene.", "robot."))])

    @property
    def is_counted(self) -> bool:
        """Return whether it completed, so that it counts in a success rate."""
        return self.result is not None and self.outcome != "cancelled"


def setting_words(settings: Mapping[str, str], keys: Iterable[str]) -> str:
    """Return ``key=value, …`` for the settings among ``keys``, each shortened."""
    return ", ".join(f"{key}={settings[key]}"[:LONGEST_SETTING] for key in keys if key in settings)
