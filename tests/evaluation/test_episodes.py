"""``eval``: seeds in order, the same document for any number of jobs, an episode that breaks is one that failed."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.launchers.launcher import LaunchOptions
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.result import RunResult
from bestman_bt.evaluation.suite import Suite, SuiteEntry

LOOK = """<root BTCPP_format="4"><BehaviorTree ID="Look"><Sequence>
  <LookAt surface="table"/>
  <DetectObject object="{object}" surface="{source}"/>
</Sequence></BehaviorTree></root>"""
BROKEN = '<root BTCPP_format="4"><BehaviorTree ID="Broken"><Break/></BehaviorTree></root>'
BREAK = '''
from behaviours.skill import Skill, SkillCoroutine


class Break(Skill):
    """Leaves something behind that breaks while the robot waits."""

    def execute(self) -> SkillCoroutine[None]:
        self.skills.clock.every(0.1, lambda: 1 / 0)
        yield self.skills.head.move_to([0.5, 0.5])
'''
STOP = '''
import os
import signal

from bestman_bt.engine import RUNNING, StatefulAction


class Stop(StatefulAction):
    """Asks for its own end."""

    def on_start(self) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        return RUNNING

    def on_running(self) -> int:
        return RUNNING
'''
DOCUMENT = [
    "name", "control", "config", "settings", "asked_episodes", "met", "targets",
    "task", "episodes", "first_seed", "succeeded", "success_rate", "interval", "audit_clean", "unclean_seeds",
    "errors", "false_successes", "unearned", "failures", "causes", "slowest", "sim_time_s", "wall_time_s",
    "real_time_factor",
    "metrics", "accuracy", "durations", "missing",
]  # fmt: skip
WALL_TIMES = ("wall_time_s", "real_time_factor")


@pytest.fixture
def look(tmp_path: Path) -> Path:
    """A tree that looks at the table and stops there: the cup stays where it is."""
    path = tmp_path / "look.xml"
    path.write_text(LOOK)
    return path


def run_all(
    config: RunConfig,
    episodes: int,
    jobs: int = 1,
    folder: Path | None = None,
    on_result: Callable[[RunResult], None] = lambda result: None,
) -> dict[str, Any]:
    """The document of an evaluation's only entry; run folders come into ``folder / "runs"``."""
    suite = Suite(config.name, (SuiteEntry(config.name, config, episodes),))
    with Evaluation(suite, folder) as evaluation:
        document: dict[str, Any] = evaluation.run(
            LocalProcesses(LaunchOptions(jobs)), lambda _, result: on_result(result)
        )["entries"][0]
        return document


def evaluate(tree: Path, jobs: int, folder: Path) -> tuple[dict[str, Any], list[RunResult]]:
    results: list[RunResult] = []
    near = ("scene.robot_start.x=[2.3, 2.4]", "scene.robot_start.y=[-0.5, -0.3]", "scene.robot_start.yaw=[0.0, 0.1]")
    config = load_run("fetch_cup", tree=tree, seed=3, settings=near)
    return run_all(config, 2, jobs, folder, results.append), results


@pytest.mark.slow
def test_two_jobs_give_the_same_document_as_one(look: Path, tmp_path: Path) -> None:
    (one, results), (two, _) = (evaluate(look, jobs, tmp_path / f"{jobs}") for jobs in (1, 2))
    assert list(one) == DOCUMENT
    assert {k: v for k, v in one.items() if k not in WALL_TIMES} == {
        k: v for k, v in two.items() if k not in WALL_TIMES
    }
    assert (one["task"], one["episodes"], one["first_seed"]) == ("fetch_cup", 2, 3)
    assert [result.seed for result in results] == [3, 4]
    assert one["sim_time_s"] == pytest.approx(sum(result.sim_time_s for result in results))
    assert set(one["metrics"]) == {"place_error_mm", "tilt_deg"}
    assert set(one["metrics"]["place_error_mm"]) == {"median", "interval", "p95"}
    # The tree says success, the cup is not at its goal: the judge is not fooled.
    assert (one["succeeded"], one["success_rate"], one["false_successes"]) == (0, 0.0, 2)
    assert one["interval"] == [0.0, 0.6576]
    assert one["audit_clean"] is True
    assert [failure["seed"] for failure in one["failures"]] == [3, 4]
    assert list(one["failures"][0]) == ["seed", "node", "error_code", "why"]
    assert one["failures"][0]["node"] == "judge"
    assert "not standing on the counter" in one["failures"][0]["why"]
    for jobs in (1, 2):
        folders = (tmp_path / f"{jobs}" / "runs").iterdir()
        assert sorted(json.loads((folder / "result.json").read_text())["seed"] for folder in folders) == [3, 4]


@pytest.mark.slow
def test_an_episode_that_breaks_counts_as_failed_with_its_cause_and_the_batch_goes_on(tmp_path: Path) -> None:
    (tmp_path / "broken.xml").write_text(BROKEN)
    (tmp_path / "break.py").write_text(BREAK)
    config = load_run("fetch_cup", tree=tmp_path / "broken.xml", seed=3, plugins=[str(tmp_path / "break.py")])
    document = run_all(config, 2, folder=tmp_path)
    assert (document["episodes"], document["succeeded"]) == (2, 0)
    why = f"ZeroDivisionError: division by zero (at {tmp_path / 'break.py'}:9)"
    assert document["failures"] == [{"seed": seed, "node": "", "error_code": "error", "why": why} for seed in (3, 4)]
    for folder in (tmp_path / "runs").iterdir():
        assert json.loads((folder / "result.json").read_text())["outcome"] == "error"


@pytest.mark.slow
def test_an_interrupt_ends_the_batch_and_what_was_done_is_summarised(look: Path) -> None:
    def interrupt(_: RunResult) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        document = run_all(load_run("fetch_cup", tree=look, seed=3), 5, on_result=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)
    assert document["episodes"] == 1


@pytest.mark.slow
def test_an_episode_that_is_stopped_ends_the_batch_and_does_not_count(tmp_path: Path) -> None:
    """As ``bestman-bt stop`` does: a robot that somebody stopped must not start anew."""
    (tmp_path / "stop.py").write_text(STOP)
    (tmp_path / "stop.xml").write_text(BROKEN.replace("Break", "Stop"))
    config = load_run("fetch_cup", tree=tmp_path / "stop.xml", seed=3, plugins=[str(tmp_path / "stop.py")])
    assert run_all(config, 5, folder=tmp_path)["episodes"] == 0
    (stopped,) = (tmp_path / "runs").iterdir()
    assert json.loads((stopped / "result.json").read_text())["outcome"] == "cancelled"
