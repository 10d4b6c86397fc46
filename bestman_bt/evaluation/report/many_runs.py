"""What many runs say together: success per task, why runs failed, which nodes took the time."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bestman_bt.evaluation.report.story import RunStory, setting_words
from bestman_bt.evaluation.summary import summarize
from bestman_bt.records.activities import work_of_nodes

MAX_SLOW_NODES = 20
MAX_DIFFERENCES = 6
"""Settings that a group's name tells."""


@dataclass(frozen=True)
class TaskGroup:
    """Runs that are counted together; ``summary``: of those that came to an end, as ``summarize`` makes it.

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
    where: str
    path: str
    type: str
    runs: int
    times: int
    failures: int
    median: float
    p95: float
    share: float


def groups_by_name(stories: Sequence[RunStory]) -> dict[str, list[RunStory]]:
    """The runs that are counted together, in the order of their first: of one task, entry, robot and settings.

    Named by entry or else task, robot, settings of scene and robot, and what else tells the group from others of its
    task and robot.
    """
    alike: dict[tuple[Any, ...], list[RunStory]] = defaultdict(list)
    for story in stories:
        alike[story.task, story.robot, story.entry, frozenset(story.settings.items())].append(story)
    same_task: dict[tuple[str, str], list[RunStory]] = defaultdict(list)
    for (task, robot, *_), mine in alike.items():
        same_task[task, robot].append(mine[0])
    named: dict[str, list[RunStory]] = {}
    for (task, robot, *_), mine in alike.items():
        name = base = _name(mine[0], _differing(same_task[task, robot]))
        number = 1
        while name in named:  # what differs is too long to be told
            number += 1
            name = f"{base} ({number})"
        named[name] = mine
    return named


def _differing(stories: Sequence[RunStory]) -> list[str]:
    """The settings that are not the same in all of them."""
    keys = dict.fromkeys(key for story in stories for key in story.settings)
    return [key for key in keys if len({story.settings.get(key) for story in stories}) > 1]


def _name(story: RunStory, differing: Sequence[str]) -> str:
    others = [key for key in differing if key in story.settings and not key.startswith(("scene.", "robot."))]
    told = setting_words(story.settings, others[:MAX_DIFFERENCES])
    if len(others) > MAX_DIFFERENCES:
        told += f" and {len(others) - MAX_DIFFERENCES} more"
    parts = (story.entry or story.task, story.robot, story.scene_and_robot_settings, told)
    return " · ".join(part for part in parts if part)


def task_groups(stories: Sequence[RunStory]) -> list[TaskGroup]:
    """As ``groups_by_name`` has them."""
    groups = []
    for name, mine in groups_by_name(stories).items():
        results = [s.result for s in sorted(mine, key=lambda s: s.seed) if s.is_counted and s.result is not None]
        summary = summarize(name, results[0].seed if results else 0, results, sum(r.wall_time_s for r in results))
        groups.append(TaskGroup(name, summary, dict(Counter(s.outcome for s in mine if not s.is_counted))))
    return groups


def causes(stories: Sequence[RunStory]) -> list[Cause]:
    """Why runs failed, the most frequent cause first."""
    found: dict[tuple[str, str], list[RunStory]] = defaultdict(list)
    for name, group in groups_by_name(stories).items():
        for story in group:
            if story.is_counted and story.result is not None and not story.result.success:
                code = story.result.failure.error_code if story.result.failure else story.outcome
                found[name, code].append(story)
    told = []
    for (task, code), mine in found.items():
        example = mine[0].result.failure if mine[0].result is not None else None
        node, why = (example.named, example.why) if example is not None else ("", "")
        told.append(Cause(task, code, len(mine), node, why, tuple(sorted(s.seed for s in mine))))
    return sorted(told, key=lambda cause: -cause.count)


def slow_nodes(stories: Sequence[RunStory]) -> list[SlowNode]:
    """The leaves that took the most time, over all runs that have a log."""
    found = []
    for task, mine in groups_by_name(stories).items():
        total = sum(story.duration for story in mine if len(story.activities))
        seconds: dict[tuple[str, str, str], list[float]] = defaultdict(list)
        counts: Counter[tuple[str, str, str]] = Counter()
        failures: Counter[tuple[str, str, str]] = Counter()
        for story in mine:
            above = {node.parent for node in story.nodes}  # a leaf that ticks a tree stands above that tree's nodes
            leaves = {node.uid: node for node in story.nodes if node.is_leaf and node.uid not in above}
            in_run: dict[tuple[str, str, str], float] = defaultdict(float)
            for key, work in work_of_nodes(story.activities).items():
                if key in leaves:
                    which = (leaves[key].where, leaves[key].path, leaves[key].type)
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
