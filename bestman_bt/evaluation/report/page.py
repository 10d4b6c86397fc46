"""The HTML page of a report: one file that needs nothing beside it; whatever runs have written is escaped."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.report.gantt import Gantt, gantt
from bestman_bt.evaluation.report.many_runs import causes, slow_nodes, task_groups
from bestman_bt.evaluation.report.story import RunStory, StoryPicture
from bestman_bt.records.activities import WorkOfNode, work_of_nodes
from bestman_bt.records.events import DescribedNode
from bestman_bt.records.palette import css_variables

TEMPLATES = Path(__file__).parent / "templates"
MAX_DETAILED = 25
"""Runs of many that are told one by one."""
MAX_NODES = 400
FAULTS = (*CHEATS, "collisions", "joint_limit_violations", "velocity_limit_violations")
"""Counters of the audit that are shown as faults where they are not 0."""


@dataclass(frozen=True)
class _ShownRun:
    story: RunStory
    chart: Gantt
    work: tuple[tuple[DescribedNode, WorkOfNode], ...]


def report_page(stories: Sequence[RunStory], now: datetime) -> str:
    """The page of one run, or of many: those that did not succeed are then told one by one."""
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    environment.filters |= {
        "data_url": _data_url,
        "moment": _moment,
        "number": _number,
        "told": _told,
        "words": lambda name: str(name).replace("_", " "),
    }
    many = len(stories) > 1
    detailed = [story for story in stories if story.outcome != "success"] if many else list(stories)
    shown = [_shown(story) for story in detailed[:MAX_DETAILED]]
    tasks = list(dict.fromkeys(story.task for story in stories))
    first = stories[0]
    page = environment.get_template("page.html").render(
        title=f"Runs of {', '.join(tasks[:4])}" if many else f"{first.task}, seed {first.seed}: {first.outcome}",
        style=Markup(css_variables() + (TEMPLATES / "style.css").read_text(encoding="utf-8")),  # noqa: S704 - our own files
        version=version("bestman-bt"),
        made=now.strftime("%Y-%m-%d %H:%M"),
        stories=stories,
        runs=shown,
        left_out=len(detailed) - len(shown),
        anchors={run.story.folder: f"run-{number}" for number, run in enumerate(shown)},
        groups=task_groups(stories) if many else [],
        causes=causes(stories) if many else [],
        slow=slow_nodes(stories) if many else [],
        faults=FAULTS,
    )
    return page.encode("utf-8", "replace").decode("utf-8")  # JSON and file names may hold halves of characters


def _shown(story: RunStory) -> _ShownRun:
    work = work_of_nodes(story.activities)
    listed = [(node, work[node.uid]) for node in story.nodes.depth_first() if node.uid in work]
    listed.sort(key=lambda item: -item[1].seconds)
    chart = gantt(story.nodes, story.activities, story.duration)
    return _ShownRun(story, chart, tuple(listed[:MAX_NODES]))


def _data_url(picture: StoryPicture) -> str:
    return f"data:image/jpeg;base64,{base64.b64encode(picture.jpeg).decode()}"


def _moment(started: float | None) -> str:
    if started is None or not 0 <= started < 4e10:
        return ""
    return datetime.fromtimestamp(started).strftime("%Y-%m-%d %H:%M:%S")


def _number(value: Any) -> str:
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    value += 0.0  # -0.0 is 0
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.3g}" if abs(value) < 1 else f"{value:.1f}"


def _told(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_told(v)}" for key, v in value.items())
    if isinstance(value, list | tuple):
        return " and ".join(_told(v) for v in value)
    return _number(value) if isinstance(value, float) else str(value)
