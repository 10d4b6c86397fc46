"""What many runs say together: success per task, why runs failed, which nodes took the time."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bestman_bt.evaluation.report.activities import work_of_nodes
from bestman_bt.evaluation.report.story import RunStory
from bestman_bt.evaluation.summary import summarize

MAX_SLOW_NODES = 20


@dataclass(frozen=True)
class TaskGroup:
    """The runs of one task, robot and settings; ``summary``: of those that came to an end, as ``summarize`` makes it.

    ``others``: outcome → how many did not come to an end of their own, and are not in the summary.
    """

    name: str
    summary: dict[str, Any]
    others: dict[str, int]


@dataclass(frozen=True)
class Cause:
    """An error code: how many runs it ended, with an example: the folder's name, the node and its words."""

    task: str
    code: str
    count: int
    node: str
    why: str
    seeds: tuple[int, ...]


@dataclass(frozen=True)
class SlowNode:
    """A leaf over all runs of a task: ``median`` and ``p95`` seconds of a run, ``share`` of the runs' time."""

    task: str
    path: str
    type: str
    runs: int
    times: int
    failures: int
    median: float
    p95: float
    share: float


def group_name(story: RunStory) -> str:
    """What runs have to have in common to be counted together."""
    return " · ".join(part for part in (story.task, story.robot, story.settings) if part)


def task_groups(stories: Sequence[RunStory]) -> list[TaskGroup]:
    """In the order of their first runs."""
    groups = []
    for name, mine in _by_group(stories).items():
        results = [s.result for s in sorted(mine, key=lambda s: s.seed) if s.is_counted and s.result is not None]
        summary = summarize(name, results[0].seed if results else 0, results, sum(r.wall_time_s for r in results))
        groups.append(TaskGroup(name, summary, dict(Counter(s.outcome for s in mine if not s.is_counted))))
    return groups


def causes(stories: Sequence[RunStory]) -> list[Cause]:
    """Why runs failed, the most frequent cause first."""
    found: dict[tuple[str, str], list[RunStory]] = defaultdict(list)
    for story in stories:
        if story.is_counted and story.result is not None and not story.result.success:
            code = story.result.failure.error_code if story.result.failure else story.outcome
            found[group_name(story), code].append(story)
    told = []
    for (task, code), mine in found.items():
        example = mine[0].result.failure if mine[0].result is not None else None
        node, why = (example.node, example.why) if example is not None else ("", "")
        told.append(Cause(task, code, len(mine), node, why, tuple(sorted(s.seed for s in mine))))
    return sorted(told, key=lambda cause: -cause.count)


def slow_nodes(stories: Sequence[RunStory]) -> list[SlowNode]:
    """The leaves that took the most time, over all runs that have a log."""
    found = []
    for task, mine in _by_group(stories).items():
        total = sum(story.duration for story in mine if story.activities)
        seconds: dict[tuple[str, str], list[float]] = defaultdict(list)
        counts: Counter[tuple[str, str]] = Counter()
        failures: Counter[tuple[str, str]] = Counter()
        for story in mine:
            above = {node.parent for node in story.nodes}  # a leaf that ticks a tree stands above that tree's nodes
            leaves = {node.key: node for node in story.nodes if node.is_leaf and node.key not in above}
            in_run: dict[tuple[str, str], float] = defaultdict(float)
            for key, work in work_of_nodes(story.activities).items():
                if key in leaves:
                    which = (leaves[key].path, leaves[key].type)
                    in_run[which] += work.seconds
                    counts[which] += work.count
                    failures[which] += work.failures
            for which, value in in_run.items():
                seconds[which].append(value)
        for which, values in seconds.items():
            median, p95 = float(np.median(values)), float(np.percentile(values, 95))
            share = sum(values) / total if total > 0 else 0.0
            found.append(SlowNode(task, *which, len(values), counts[which], failures[which], median, p95, share))
    return sorted(found, key=lambda node: -node.share)[:MAX_SLOW_NODES]


def _by_group(stories: Sequence[RunStory]) -> dict[str, list[RunStory]]:
    groups: dict[str, list[RunStory]] = defaultdict(list)
    for story in stories:
        groups[group_name(story)].append(story)
    return groups
