"""``run``: what it prints and leaves, and how it is stopped from outside. Short trees; the whole fetch is elsewhere."""

from __future__ import annotations

import io
import json
import logging
import stat
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from bestman_bt.cli.run_command import RunOptions, no_faster_than_real_time, run_request
from bestman_bt.cli.run_view import ProgressConsole, RunView
from bestman_bt.configuration.run import RunRequest, load_run, run_of_options
from bestman_bt.engine import RUNNING, SUCCESS, ManualClock, NodeRegistry, StatefulAction, Tree, load_tree
from bestman_bt.evaluation.audit import audit
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.monitor.control_client import request
from bestman_bt.records.reader import read
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import MobileBase
from hal.simulation.audit_record import AuditRecord
from hal.simulation.robot import SimulatedRobot
from tests.cli.command_line import Answer, Program, wait_for

Command = Callable[..., Answer]

LOOK = '<root BTCPP_format="4"><BehaviorTree ID="Look"><MoveArm posture="carry"/></BehaviorTree></root>'
DRIVE = '<root BTCPP_format="4"><BehaviorTree ID="Drive"><NavigateTo goal="1.5;-0.4;0"/></BehaviorTree></root>'
NOISE = '''
import os

from bestman_bt.engine import action

print("a plug-in says hello")


@action
def shout() -> bool:
    """Print in Python and, as C libraries do, to the file descriptor."""
    print("python")
    os.write(1, b"descriptor\\n")
    return True


def register(registry):
    registry.register(shout, "Shout")
'''


def only_folder(parent: Path) -> Path:
    (found,) = parent.iterdir()
    return found


@pytest.mark.slow
def test_nothing_odd_is_said_of_a_tree_that_includes_shipped_subtrees(bestman_bt: Command, folder: Path) -> None:
    body = '<Fallback><AlwaysSuccess/><SubTree ID="Pick" object="cup" surface="table"/></Fallback>'
    (folder / "mine.xml").write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Mine"><include path="subtrees/pick_and_place.xml"/>'
        f'<BehaviorTree ID="Mine">{body}</BehaviorTree></root>'
    )
    answer = bestman_bt("run", "mine.xml", "--seed", "3", "--json")
    assert (answer.code, "include" in answer.err, "SubTree" in answer.err) == (0, False, False), answer.err


def test_a_tree_in_place_of_a_tasks_own_names_the_run() -> None:
    named = [run_request(tree, RunOptions(task=task)).name for tree, task in (("a/mine.xml", "fetch_cup"), (None, "x"))]
    assert named == ["mine", ""]
    assert run_of_options(RunRequest(task="fetch_cup", tree="bring_two", name="mine")).name == "mine"


@pytest.mark.slow
def test_what_is_odd_about_a_tree_is_printed_before_it_runs_and_does_not_stop_it(
    bestman_bt: Command, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    odd = '<Sequence><Repeat num_cycles="1x"><AlwaysSuccess/></Repeat>\n'
    odd += '<ForceSuccess><LookAt surface="{surfce}"/></ForceSuccess></Sequence>'
    (folder / "odd.xml").write_text(f'<root BTCPP_format="4">\n<BehaviorTree ID="Odd">{odd}</BehaviorTree></root>')
    answer = bestman_bt("run", "odd.xml", "--seed", "3", "--json")
    assert answer.code == 0
    (warning,) = (line for line in answer.err.splitlines() if "odd.xml:2:" in line)
    assert "only the beginning of '1x' is read as a number" in warning
    assert answer.err.index(warning) < answer.err.index("odd, seed 3")
    (unwritten,) = (line for line in (*answer.err.splitlines(), *caplog.messages) if "odd.xml:3: warning" in line)
    assert "reads '{surfce}', which nothing in the tree writes" in unwritten
    assert json.loads(answer.out)["success"] is True


def test_a_tree_without_a_task_runs_and_is_not_judged(bestman_bt: Command, folder: Path) -> None:
    (folder / "look.xml").write_text(LOOK)
    answer = bestman_bt("run", "look.xml", "--seed", "3")
    assert answer.code == 0
    result = json.loads((only_folder(folder / "runs") / "result.json").read_text())
    assert (result["task"], result["seed"], result["success"], result["predicate"]) == ("look", 3, True, None)
    assert only_folder(folder / "runs").name.endswith("-look-3")
    assert "MoveArm" in answer.err
    assert ("look, seed 3" in answer.out, "look, seed 3" in answer.err) == (True, False)
    assert "MoveArm" not in answer.out


def test_a_tree_that_succeeds_without_reaching_the_goal_is_no_success(bestman_bt: Command, folder: Path) -> None:
    (folder / "look.xml").write_text(LOOK)
    answer = bestman_bt("run", "look.xml", "--task", "fetch_cup", "--runs", "elsewhere", "--json")
    assert answer.code == 1
    result = answer.document
    assert (result["tree_status"], result["predicate"], result["outcome"]) == ("SUCCESS", False, "failure")
    assert result["failure"]["node"] == "judge"
    assert "not standing on the counter" in result["failure"]["why"]
    assert result == json.loads((only_folder(folder / "elsewhere") / "result.json").read_text())


@pytest.mark.slow
def test_a_node_that_raises_is_an_error_in_the_result(bestman_bt: Command, folder: Path) -> None:
    (folder / "break.py").write_text(
        "from bestman_bt.engine import SyncAction\n\n\n"
        "class Break(SyncAction):\n    def on_tick(self):\n        raise ValueError('the gear is stripped')\n"
    )
    (folder / "t.xml").write_text(LOOK.replace('<MoveArm posture="carry"/>', "<Break/>"))
    answer = bestman_bt("run", "t.xml", "--plugin", "break.py", "--json")
    assert answer.code == 1
    assert answer.document["outcome"] == "error"
    assert "the gear is stripped" in answer.document["failure"]["why"]
    assert "Traceback" not in answer.err


@pytest.mark.slow
def test_a_tree_that_ends_the_program_when_it_is_halted_is_an_error_in_the_result(
    bestman_bt: Command, folder: Path
) -> None:
    (folder / "leave.py").write_text(
        "import sys\nfrom bestman_bt.engine import RUNNING, StatefulAction\n\n\n"
        "class Leave(StatefulAction):\n    def on_start(self):\n        return RUNNING\n\n"
        "    def on_running(self):\n        return RUNNING\n\n"
        "    def on_halted(self):\n        sys.exit(0)\n\n\n"
        "def build():\n    return Leave()\n"
    )
    answer = bestman_bt("run", "leave.py", "--set", "time_limit=0.2 s", "--json")
    assert answer.code == 1
    assert answer.document["outcome"] == "error"
    assert "[Leave]: SystemExit: 0 (at " in answer.document["failure"]["why"]
    assert answer.document == json.loads((only_folder(folder / "runs") / "result.json").read_text())


SAVE = '''
from pathlib import Path

from bestman_bt.engine import RUNNING, SUCCESS, StatefulAction


class Save(StatefulAction):
    """Changes the file of its tree, as an editor does, and runs for another tick."""

    def on_start(self):
        tree = Path("t.xml")
        tree.write_text(tree.read_text().replace("AlwaysFailure", "AlwaysSuccess"))
        return RUNNING

    def on_running(self):
        return SUCCESS

    def on_halted(self):
        pass
'''
SAVED = '<root BTCPP_format="4"><BehaviorTree ID="T"><Sequence><Save/><AlwaysFailure/></Sequence></BehaviorTree></root>'


@pytest.mark.slow
def test_a_tree_that_is_saved_while_it_runs_is_taken_and_noted(bestman_bt: Command, folder: Path) -> None:
    (folder / "save.py").write_text(SAVE)
    for options, status in (((), "FAILURE"), (("--watch",), "SUCCESS")):
        (folder / "t.xml").write_text(SAVED)
        answer = bestman_bt("run", "t.xml", "--plugin", "save.py", "--json", *options)
        assert answer.document["tree_status"] == status, answer.err
    (mark,) = answer.document["interventions"]
    assert "t.xml was read again: 2 of its 3 nodes were running and continue" in mark
    newest = sorted((folder / "runs").iterdir())[-1]
    history = read(newest)
    names = ["Sequence", "Save", "AlwaysFailure", "Sequence", "Save", "AlwaysSuccess"]
    assert [node.name for node in history.nodes] == ["T", *names]
    assert any("was read again" in line["message"] for line in history.lines_since(0, 100))
    assert bestman_bt("report", newest, "-o", "r.html").code == 0


@pytest.mark.parametrize(
    ("tree", "options", "why"),
    [("t.py", (), "is for trees in XML"), ("t.xml", ("--pretend",), "does not go with --pretend")],
)
def test_what_cannot_be_watched_is_refused_before_anything_starts(
    bestman_bt: Command, folder: Path, tree: str, options: tuple[str, ...], why: str
) -> None:
    (folder / tree).write_text(LOOK)
    answer = bestman_bt("run", tree, "--watch", *options)
    assert answer.code == 2
    assert f"--watch: {why}" in answer.err
    assert not (folder / "runs").exists()


@pytest.mark.slow
def test_with_json_standard_output_holds_one_document_whatever_is_printed(folder: Path) -> None:
    """As a program of its own: C libraries print past Python."""
    (folder / "noise.py").write_text(NOISE)
    (folder / "t.xml").write_text(LOOK.replace('<MoveArm posture="carry"/>', "<Shout/>"))
    answer = Program("run", "t.xml", "--plugin", "noise.py", "--json", folder=folder).answer()
    assert answer.code == 0
    assert answer.out.count("\n") == 1
    assert answer.document["outcome"] == "success"
    for noise in ("a plug-in says hello", "python", "descriptor"):
        assert noise in answer.err


@pytest.fixture
def driving(folder: Path) -> tuple[Program, Path]:
    """A run that drives across the room, in a process of its own, and its control socket."""
    (folder / "drive.xml").write_text(DRIVE)
    program = Program("run", "drive.xml", "--json", folder=folder)
    return program, wait_for(folder, "runs/*/control.sock")


def assert_cancelled(answer: Answer, folder: Path, why: str) -> None:
    assert answer.code == 130
    result = answer.document
    assert (result["outcome"], result["success"], result["tree_status"]) == ("cancelled", False, "IDLE")
    failure = result["failure"]
    assert (failure["node"], failure["error_code"], failure["why"], failure["part"]) == ("", "cancelled", why, "")
    run = only_folder(folder / "runs")
    assert json.loads((run / "result.json").read_text()) == result
    assert not (run / "control.sock").is_symlink()


def wait_until_it_drives(socket: Path) -> None:
    while request(socket, {"do": "status"})["ticks"] < 40:
        pass


@pytest.mark.slow
def test_stop_in_another_process_ends_a_run_as_cancelled(
    driving: tuple[Program, Path], bestman_bt: Command, folder: Path
) -> None:
    program, socket = driving
    assert stat.S_IMODE(socket.stat().st_mode) == 0o600
    wait_until_it_drives(socket)
    told = bestman_bt("stop")
    assert told.code == 0
    assert told.out.startswith(f"stopped drive (process {program.process.pid}, tick ")
    assert_cancelled(program.answer(), folder, "stopped through the control channel")
    assert bestman_bt("stop").out == "nothing is running\n"


def test_ctrl_c_ends_a_run_as_cancelled(driving: tuple[Program, Path], folder: Path) -> None:
    program, socket = driving
    wait_until_it_drives(socket)
    program.interrupt()
    assert_cancelled(program.answer(), folder, "interrupted from the keyboard")


@pytest.mark.slow
def test_ctrl_c_ends_an_evaluation_on_two_processes_and_what_was_done_is_summarised(folder: Path) -> None:
    (folder / "look.xml").write_text(LOOK)
    program = Program(
        *(
            "eval",
            "fetch_cup",
            "--set",
            "tree=look.xml",
            "--episodes",
            "200",
            "--jobs",
            "2",
            "--json",
        ),
        folder=folder,
    )
    wait_for(folder, "runs/evaluations/fetch_cup/runs/*-fetch_cup-4/transitions.btlog")
    program.interrupt()
    answer = program.answer(timeout=60.0)
    assert answer.code == 130
    assert "kept in runs/evaluations/fetch_cup" in answer.err
    assert 2 <= answer.document["episodes"] < 100
    assert answer.document["false_successes"] == answer.document["episodes"]
    assert "Traceback" not in answer.err


def test_a_stop_leaves_the_robot_at_rest(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, to look at the wheels: stopped by request while it drives, at rest half a second later."""
    (folder / "drive.xml").write_text(DRIVE)
    driven, rested = [], []

    def speed(robot: SimulatedRobot) -> float:
        twist = robot.part("base", MobileBase).velocity()
        return max(abs(twist.vx), abs(twist.wz))

    def stop_when_it_drives(session: RobotSession, tree: Tree) -> Callable[[], None]:
        def after_tick() -> None:
            if not driven and speed(session.robot) > 0.2:
                driven.append(speed(session.robot))
                asking = threading.Thread(target=request, args=(folder / "control.sock", {"do": "stop"}))
                asking.start()
                asking.join()

        return after_tick

    disconnect = SimulatedRobot.disconnect

    def look_and_disconnect(robot: SimulatedRobot) -> None:
        rested.append(speed(robot))
        disconnect(robot)

    monkeypatch.setattr(SimulatedRobot, "disconnect", look_and_disconnect)
    config = load_run(tree="drive.xml", scene="kitchen", robot="diff_panda")
    assert run_episode(config, folder, watch=stop_when_it_drives).outcome == "cancelled"
    assert driven
    assert rested[0] < 0.01


def test_a_run_in_real_time_waits_for_the_wall_clock_and_does_not_catch_up() -> None:
    simulated, wall = ManualClock(), ManualClock()
    session = SimpleNamespace(robot=SimpleNamespace(clock=simulated))
    after_tick = no_faster_than_real_time(session, None, wall.now, wall.sleep)
    ended = []
    for computing in (0.0, 0.25, 0.0, 0.0):
        simulated.sleep(0.125)
        wall.sleep(computing)
        after_tick()
        ended.append(wall.now())
    assert ended == [0.125, 0.375, 0.5, 0.625]


class _Plans(StatefulAction):
    """Ticks a tree of its own, as ExecutePlan does."""

    def on_start(self) -> int:
        self.inner = load_tree(
            '<root BTCPP_format="4"><BehaviorTree ID="Plan"><AlwaysSuccess name="open"/></BehaviorTree></root>',
            clock=self.clock,
        )
        self.owner.announce_inner(self.inner, self)
        return RUNNING

    def on_running(self) -> int:
        return self.inner.tick_once()


def test_the_terminal_reports_what_a_tree_within_a_leaf_does_in_seconds_of_the_run(
    capsys: pytest.CaptureFixture[str],
) -> None:
    registry, clock = NodeRegistry(), ManualClock()
    registry.register(_Plans, "Plans")
    clock.sleep(7.5)
    tree = load_tree(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Plans name="plans"/></BehaviorTree></root>', registry, clock=clock
    )
    with RunView("a run") as view:
        view.watch(SimpleNamespace(robot=SimpleNamespace(clock=clock)), tree)
        tree.tick_once()
        clock.sleep(0.25)
        tree.tick_once()
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["[   0.00 s] ▶ plans running", "[   0.25 s] ✓ open success", "[   0.25 s] ✓ plans success"]


def test_warnings_and_errors_of_a_run_are_on_the_terminal_while_it_runs_and_tracebacks_are_not(
    capsys: pytest.CaptureFixture[str],
) -> None:
    clock, logger = ManualClock(), logging.getLogger("bestman_bt.engine.reloading")
    clock.sleep(7.5)
    session: Any = SimpleNamespace(robot=SimpleNamespace(clock=clock))
    tree = load_tree('<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>', clock=clock)
    with RunView("a run") as view:
        view.watch(session, tree)
        clock.sleep(5.4)
        logger.info("a line of the log alone")
        logger.warning("the changed tree waits: %s", "walk [bold] is running")
        logger.error("the execution ended in an error", exc_info=ValueError("no such cup"))
    logger.info("after the run")
    assert capsys.readouterr().err.splitlines() == [
        "[   5.40 s] warning: the changed tree waits: walk [bold] is running",
        "[   5.40 s] error: the execution ended in an error: ValueError('no such cup')",
    ]


def test_a_run_continues_when_the_reader_of_its_progress_goes_away(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr("bestman_bt.cli.run_view.CONSOLE", ProgressConsole(file=Gone()))
    clock = ManualClock()
    tree = load_tree('<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>', clock=clock)
    session: Any = SimpleNamespace(robot=SimpleNamespace(clock=clock))
    with RunView("a run") as view:
        view.watch(session, tree)
        logging.getLogger("hal").warning("late")
        assert tree.tick_once() == SUCCESS


def test_the_summary_reports_what_was_measured_every_cheat_and_whose_success_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bestman_bt.cli.run_view.RESULTS", Console(width=200))
    audited = audit(AuditRecord(10.0, 0, 0, 0, 40, {}, (), (), (), (), (), (), (), (), ())).to_document()
    audited["disturbances"] = ["13.00 s: a person moves the cup by 5.05 m, on counter/top"]
    metrics = {"final_error_mm": 2.34, "path_ratio": 1.0432, "tilt_deg": 0.26, "tilt_deg_cup": 0.2}
    result = RunResult("drive", 7, True, Outcome.SUCCESS, "SUCCESS", True, None, audited, metrics, 1.0, 1.0)
    setup: Any = SimpleNamespace(goals=[SimpleNamespace(object="cup", source="table", surface="counter")])
    rows = []
    for one in (result, replace(result, held_at_start=True)):
        RunView("drive").summary(one, setup, tmp_path)
        rows.append([" ".join(line.split()) for line in capsys.readouterr().out.splitlines()])
    assert "fetched the cup from the table to the counter" in rows[0]
    assert "measured final error 2.3 mm, path ratio 1.04, tilt 0.3°" in rows[0]
    assert "disturbance 13.00 s: a person moves the cup by 5.05 m, on counter/top" in rows[0]
    counters = "teleports 0, grasp constraints 0, ground truth reads 0, tampering 40, object follows open hand 0"
    assert f"audit {counters}, collisions 0, deepest contact 0.00 mm" in rows[0]
    assert set(rows[1]) - set(rows[0]) == {"note the goal held before the run began: the success is not the robot's"}
    assert "fetched the cup from the table to the counter" not in rows[1]
