"""The whole fetch on one seed: it succeeds, honestly, leaves what a run owes, and can be repeated to the bit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import load_run, read_run
from bestman_bt.engine import IDLE, RUNNING, SUCCESS
from bestman_bt.engine.logs.btlog import read_btlog
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.runtime.resolved_config import load_for, prepare
from bestman_bt.runtime.world_file import read_world
from bestman_bt.task_planning.state import read_state
from bestman_bt.task_planning.symbolic.facts import parse_fact
from tests.cli.command_line import Program
from tests.evaluation.conftest import SEED, Fetch

WALL_TIMES = ("wall_time_s", "real_time_factor")
AGAIN = """
import json, sys
from pathlib import Path
from bestman_bt.configuration.run import read_run
from bestman_bt.evaluation.episode import run_episode
print(json.dumps(run_episode(read_run(Path(sys.argv[1]))).to_document()))
"""


def without_wall_times(result: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in result.items() if name not in WALL_TIMES}


def test_the_cup_is_fetched_and_the_judge_agrees_with_the_tree(fetch: Fetch) -> None:
    assert fetch.answer.code == 0
    result = fetch.result
    assert (result["success"], result["outcome"], result["failure"]) == (True, "success", None)
    assert (result["tree_status"], result["predicate"]) == ("SUCCESS", True)
    assert result["metrics"]["place_error_mm"] < 20.0
    assert result["metrics"]["tilt_deg"] < 10.0


def test_the_audit_of_the_fetch_finds_nothing(fetch: Fetch) -> None:
    audit = fetch.result["audit"]
    counters = {name: value for name, value in audit.items() if isinstance(value, int)}
    assert {
        "teleports", "grasp_constraints", "ground_truth_reads", "collisions",
        "joint_limit_violations", "velocity_limit_violations",
    } <= set(counters)  # fmt: skip
    assert set(counters.values()) == {0}
    assert audit["findings"] == []
    assert audit["disturbances"] == []
    assert 0.0 < audit["max_penetration_mm"] < 2.0


def test_the_result_has_the_fields_that_a_run_owes(fetch: Fetch) -> None:
    result = fetch.result
    assert list(result) == [
        "task", "seed", "success", "outcome", "tree_status", "predicate", "failure", "audit", "metrics",
        "sim_time_s", "wall_time_s", "durations", "not_judged", "held_at_start", "moved_by_others",
        "not_kept", "interventions", "pretended", "judged", "real_time_factor", "versions",
    ]  # fmt: skip
    assert (result["task"], result["seed"]) == ("fetch_cup", SEED)
    assert 10.0 < result["sim_time_s"] < 120.0
    assert result["real_time_factor"] == pytest.approx(result["sim_time_s"] / result["wall_time_s"], abs=0.001)
    assert {"python", "bestman-bt", "pybullet"} <= set(result["versions"])


def test_the_run_folder_holds_result_configuration_logs_and_beliefs_and_no_more(fetch: Fetch) -> None:
    logs = {"events.jsonl", "log.jsonl", "motion.jsonl", "transitions.btlog"}
    assert {path.name for path in fetch.folder.iterdir()} == {"config.yaml", "result.json", "world.yaml", *logs}
    assert fetch.folder.name.endswith(f"-fetch_cup-{SEED}")
    assert json.loads((fetch.folder / "result.json").read_text()) == fetch.result


def test_what_the_robot_believed_at_the_end_can_be_planned_from(fetch: Fetch) -> None:
    file = read_world(fetch.folder / "world.yaml")
    assert (file.scene, file.seed) == ("kitchen", SEED)
    state = read_state(Beliefs(file.world_model(prepare(load_run("fetch_cup", seed=SEED)))))
    assert {parse_fact("on(cup, counter/top)"), parse_fact("hand_empty")} <= state


def test_the_transitions_report_the_run_from_the_first_tick_to_the_last(fetch: Fetch) -> None:
    log = read_btlog(fetch.folder / "transitions.btlog")
    names = {node.uid: type(node).__name__ for node in load_for(prepare(load_run("fetch_cup", seed=SEED))).nodes}
    root = [transition for transition in log.transitions if transition.uid == 1]
    assert [root[0].status, root[-2].status, root[-1].status] == [RUNNING, SUCCESS, IDLE]
    assert root[-2].time == pytest.approx(fetch.result["sim_time_s"], abs=0.06)
    times = [transition.time for transition in log.transitions]
    assert times == sorted(times)
    succeeded = {names[transition.uid] for transition in log.transitions if transition.status == SUCCESS}
    assert {"NavigateTo", "DetectObject", "Grasp", "PlaceOn", "Release", "ObjectAt"} <= succeeded


def test_the_live_events_name_the_leaves_and_their_outcome(fetch: Fetch) -> None:
    assert "✓ Grasp success: cup in hand" in fetch.answer.err
    assert "fetched            the cup from the table to the counter" in fetch.answer.err


def test_the_configuration_is_the_run(fetch: Fetch) -> None:
    assert read_run(fetch.folder / "config.yaml") == load_run("fetch_cup", seed=SEED, tree="fetch_cup")


@contextmanager
def busy(cpu: int) -> Iterator[None]:
    """Another process that takes some of one processor: a tenth, so that the test takes no longer than it has to."""

    def prepare() -> None:
        os.sched_setaffinity(0, {cpu})
        os.nice(10)

    loop = subprocess.Popen([sys.executable, "-c", "while True: pass"], preexec_fn=prepare)
    try:
        yield
    finally:
        loop.kill()
        loop.wait()


@pytest.mark.slow
def test_run_again_from_its_configuration_on_a_loaded_processor_it_gives_the_same_result(fetch: Fetch) -> None:
    """On one processor, shared with a busy loop: another speed, another number of threads, another order of them."""
    cpu = min(os.sched_getaffinity(0))
    with busy(cpu):
        again = subprocess.run(
            [sys.executable, "-c", AGAIN, str(fetch.folder / "config.yaml")],
            preexec_fn=lambda: os.sched_setaffinity(0, {cpu}),
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
            capture_output=True,
            text=True,
            check=True,
        )
    result = json.loads(again.stdout)
    assert without_wall_times(result) == without_wall_times(fetch.result)


def test_the_tree_written_in_python_is_the_tree_written_in_xml() -> None:
    setup = prepare(load_run("fetch_cup", seed=SEED))
    xml, python = load_for(setup, "fetch_cup"), load_for(setup, "fetch_cup_python")
    assert [(type(node).__name__, node.path) for node in python.nodes] == [
        (type(node).__name__, node.path) for node in xml.nodes
    ]


@pytest.mark.slow
def test_the_tree_written_in_python_does_the_same_at_the_same_times(fetch: Fetch, tmp_path: Path) -> None:
    """Compared for the first 17 seconds, up to the grasp."""
    limit = 17.0
    answer = Program(
        *("run", "fetch_cup_python", "--task", "fetch_cup", "--seed", SEED, "--set", f"time_limit={limit} s", "--json"),
        folder=tmp_path,
    ).answer()
    assert answer.document["failure"]["error_code"] == "timeout"
    (folder,) = (tmp_path / "runs").iterdir()
    logs = [read_btlog(path / "transitions.btlog").transitions for path in (folder, fetch.folder)]
    python, xml = ([t for t in log if t.time < limit - 0.1] for log in logs)
    assert len(xml) > 25
    assert python == xml
