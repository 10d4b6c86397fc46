"""pause, step, resume, set, status and stop from the shell, on executors that really run."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from bestman_bt.engine import WallClock, load_tree
from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.telemetry import Telemetry
from tests.cli.command_line import Answer

Command = Callable[..., Answer]
TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Sequence name="work"><Sleep name="wait" msec="600000"/></Sequence>
</BehaviorTree></root>"""


@pytest.fixture
def start(folder: Path, own_sockets: None) -> Iterator[Callable[[str], Executor]]:
    """Starts executions of a task; all are ended afterwards."""
    with ExitStack() as stack:

        def started(task: str) -> Executor:
            clock = WallClock()
            executor = Executor(load_tree(TREE, clock=clock), clock, period=0.005)
            run = RunEvent(task, "Main", "", "", 0, f"/runs/1-{task}", os.getpid(), time.time(), 200.0, "real")
            telemetry = stack.enter_context(Telemetry(executor, run))
            channel = ControlChannel(executor, lambda: None, telemetry, lambda: {"parts": {"arm": "ok"}, "robot": {}})
            stack.enter_context(channel.serving())
            thread = threading.Thread(target=executor.run)
            stack.callback(thread.join, 5.0)
            stack.callback(executor.cancel)
            thread.start()
            return executor

        yield started


def test_one_run_is_paused_stepped_set_and_resumed_without_being_named(
    bestman_bt: Command, start: Callable[[str], Executor]
) -> None:
    executor = start("fetch")
    executor.tree.blackboard.set("speed", 1.0)

    assert bestman_bt("pause").out.startswith("paused fetch at tick ")
    ticks = json.loads(bestman_bt("status", "--json").out)["runs"][0]["ticks"]
    assert f"stepped fetch to tick {ticks + 1}, " in bestman_bt("step").out
    written = bestman_bt("set", "speed=0.5")
    assert (written.code, written.out, written.err) == (0, "set speed = 0.5 in fetch\n", "")
    assert executor.tree.blackboard.get("speed") == 0.5
    misspelt = bestman_bt("set", "sped=0.2")
    assert (misspelt.code, misspelt.out) == (0, "set sped = 0.2 in fetch\n")
    assert misspelt.err == "note: 'sped' is a new entry, which no node of the tree names; did you mean 'speed'?\n"
    assert executor.tree.blackboard.get("sped") == 0.2
    assert bestman_bt("set", "sped=0.3").err == ""
    assert bestman_bt("speed", "30%").out == "fetch runs at 30% of its speed\n"
    assert bestman_bt("speed").out == "fetch runs at 30% of its speed\n"
    assert "paused at 30% of its speed, tick" in bestman_bt("status").out
    for wrong in ("3%", "150%", "0", "fast"):
        refused = bestman_bt("speed", wrong)
        assert (refused.code, "a speed is 5% to 100%" in refused.err) == (1 if wrong == "3%" else 2, True)
    assert bestman_bt("speed", "1").out == "fetch runs at 100% of its speed\n"
    assert bestman_bt("set", "object=the cup").out == 'set object = "the cup" in fetch\n'
    assert bestman_bt("resume").out.startswith("resumed fetch")
    assert not executor.paused


def test_status_tells_run_active_leaves_parts_and_last_failure(
    bestman_bt: Command, start: Callable[[str], Executor]
) -> None:
    executor = start("fetch")
    while executor.ticks < 2:
        time.sleep(0.005)

    (status,) = bestman_bt("status", "--json").document["runs"]
    assert 0.0 < status["time"] < 60.0 < executor.clock.now()  # since the start, not of the clock
    assert (status["task"], status["run"], status["active"]) == ("fetch", "1-fetch", ["wait"])
    assert (status["parts"], status["last_failure"], status["paused"]) == ({"arm": "ok"}, None, False)
    text = bestman_bt("status").out
    assert "  active: wait\n  parts: arm ok" in text


def test_of_several_runs_one_is_named_by_task_or_folder_and_stopped_alone(
    bestman_bt: Command, start: Callable[[str], Executor]
) -> None:
    first, second = start("fetch"), start("tidy")

    refused = bestman_bt("pause")
    assert (refused.code, "several executions run" in refused.err, "/runs/1-tidy" in refused.err) == (2, True, True)
    assert bestman_bt("step", "fetsh").err.startswith("bestman-bt: no running execution is named 'fetsh'; name one of")
    assert bestman_bt("pause", "tidy").code == 0
    assert (first.paused, second.paused) == (False, True)
    for name in ("/runs/1-tidy", f"{os.path.relpath('/runs/1-tidy')}/"):
        assert bestman_bt("resume", name).out.startswith("resumed tidy")
    assert bestman_bt("stop", "1-fetch").out.startswith("stopped fetch")
    assert len(bestman_bt("stop", "--all").out.splitlines()) in (1, 2)  # the first may have ended already


def test_a_task_that_runs_twice_is_no_name_of_one(bestman_bt: Command, start: Callable[[str], Executor]) -> None:
    start("fetch"), start("fetch")
    assert "2 running executions are named 'fetch'" in bestman_bt("pause", "fetch").err


def test_where_nothing_runs_the_exit_code_is_1(bestman_bt: Command) -> None:
    assert bestman_bt("status", "--json").document == {"runs": []}
    for verb in ("status", "pause", "step", "resume"):
        answer = bestman_bt(verb)
        assert (answer.code, answer.err) == (1, "nothing is running\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["set", "speed"], "should be KEY=VALUE, got 'speed'"),
        (["stop", "fetch", "--all"], "one run or --all, not both"),
    ],
)
def test_wrong_input_is_refused(bestman_bt: Command, arguments: list[str], words: str) -> None:
    answer = bestman_bt(*arguments)
    assert answer.code == 2
    assert words in " ".join(answer.err.replace("│", " ").split())


def test_a_run_waits_at_a_breakpoint_until_it_is_cleared(bestman_bt: Command, start: Callable[[str], Executor]) -> None:
    executor = start("fetch")
    assert bestman_bt("pause").code == 0
    assert bestman_bt("break", "wait", "--after", "--if", "speed > 1").out == "fetch waits after wait if speed > 1\n"
    assert bestman_bt("break", "2").out == "fetch waits before wait\n"
    assert [
        (one["when"], one["condition"]) for one in bestman_bt("status", "--json").document["runs"][0]["breakpoints"]
    ] == [
        ("after", "speed > 1"),
        ("before", None),
    ]
    assert bestman_bt("unbreak", "wait").out == "cleared 2 in fetch; left: none\n"
    assert bestman_bt("break", "work", "--once").code == 0
    assert bestman_bt("unbreak", "--all", "--run", "fetch").out == "cleared 1 in fetch; left: none\n"
    assert executor.paused


def test_status_and_step_report_the_node_at_which_a_run_waits(
    bestman_bt: Command, start: Callable[[str], Executor]
) -> None:
    executor = start("fetch")
    assert bestman_bt("pause").code == 0
    while executor.held_at is None:
        time.sleep(0.005)
    asked = {"reason": "asked", "node": None, "when": None}
    assert bestman_bt("status", "--json").document["runs"][0]["held_at"] == asked
    assert ": paused, tick " in bestman_bt("status").out

    assert bestman_bt("break", "wait", "--if", "go == 1").code == 0
    assert bestman_bt("set", "go=1").code == 0
    assert bestman_bt("step").out.rstrip().endswith(", before wait")
    held = {"reason": "breakpoint", "node": "wait", "when": "before"}
    assert bestman_bt("status", "--json").document["runs"][0]["held_at"] == held
    assert ": paused, before wait, tick " in bestman_bt("status").out
    assert bestman_bt("resume").code == 0
    while executor.held_at is not None:
        time.sleep(0.005)
    assert bestman_bt("status", "--json").document["runs"][0]["held_at"] is None


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("break", "wiat"), 1, "did you mean 'wait'?"),
        (("break", "9"), 1, "a node should be a path or a number from 1 to 2, got 9"),
        (("break", "wait", "--if", "speed >"), 1, "speed >"),
        (("unbreak", "wiat"), 1, "did you mean 'wait'?"),
        (("break", "fetch_and_bring/in_time/wiat"), 1, "did you mean 'wait'?"),
        (("unbreak",), 2, "give a node, or --all"),
        (("unbreak", "wait", "--all"), 2, "give a node, or --all"),
        (("break", "wait", "--run", "tidy"), 2, "no running execution is named 'tidy'"),
    ],
)
def test_a_breakpoint_that_makes_no_sense_is_refused(
    arguments: tuple[str, ...], code: int, told: str, bestman_bt: Command, start: Callable[[str], Executor]
) -> None:
    start("fetch")
    answer = bestman_bt(*arguments)
    assert answer.code == code
    assert told in answer.err
