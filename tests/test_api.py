"""``import bestman_bt as bt``: the way in from Python."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import bestman_bt as bt
from bestman_bt.engine import RUNNING, SUCCESS, AlwaysSuccess, Sequence
from bestman_bt.evaluation.result import Outcome
from hal.api import NotConnectedError

CARRY = '<root BTCPP_format="4"><BehaviorTree ID="Main"><MoveArm posture="carry"/></BehaviorTree></root>'
HEAVY = ("pybullet", "pinocchio", "ompl", "toppra", "matplotlib", "trimesh", "cv2", "rerun", "ssl", "scipy", "pydantic")


def test_the_import_and_a_trees_load_bring_nothing_heavy() -> None:
    assert _loaded_after("import bestman_bt", *HEAVY, "numpy") == []
    assert _loaded_after("import bestman_bt as bt; bt.load_tree('fetch_cup')", *HEAVY[:-2]) == []


def _loaded_after(program: str, *names: str) -> list[str]:
    text = f"{program}; import sys; print(*[name for name in {names} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return ran.stdout.split()


def test_trees_are_loaded_by_name_file_text_and_node(tmp_path: Path) -> None:
    (tmp_path / "carry.xml").write_text(CARRY)
    assert bt.load_tree("fetch_cup").tree_id == "Fetch"
    assert [node.type_id for node in bt.load_tree(tmp_path / "carry.xml").nodes] == ["MoveArm"]
    assert [node.type_id for node in bt.load_tree(CARRY).nodes] == ["MoveArm"]
    assert bt.load_tree(Sequence("all", [AlwaysSuccess()])).root.name == "all"
    with pytest.raises(bt.Error, match=r"did you mean 'MoveArm'"):
        bt.load_tree(CARRY.replace("MoveArm", "MoveArn"))


def test_nodes_are_described_by_name() -> None:
    known = bt.nodes()
    assert known["NavigateTo"].kind == "Action"
    assert {"Sequence", "Inverter", "Holding"} <= set(known)


def test_the_old_name_says_the_new_one() -> None:
    with pytest.raises(AttributeError, match=r"use bestman_bt\.Session"):
        bt.session  # noqa: B018 - reading it raises
    with pytest.raises(AttributeError, match=r"has no attribute 'sesion'$"):
        bt.sesion  # noqa: B018 - reading it raises


def test_a_session_that_is_not_open_reports_how_to_open_it() -> None:
    with pytest.raises(NotConnectedError, match=r"with bestman_bt\.Session"):
        bt.Session(scene="kitchen").run("fetch_cup")
    with pytest.raises(bt.Error, match=r"robot='nope': unknown robot"), bt.Session(robot="nope"):
        pass


def test_runs_of_a_session_follow_each_other_and_are_judged(tmp_path: Path) -> None:
    """A tree without a goal, ticked and run, then one that is loaded without a robot and has a goal of its own."""
    with bt.Session(scene="pick_place_table", robot="diff_panda", seed=3) as session:
        result = session.run(CARRY, tmp_path / "run")
        assert (result.outcome, result.judged) == (Outcome.SUCCESS, False)
        assert json.loads((tmp_path / "run" / "result.json").read_text()) == result.to_document()
        with pytest.raises(bt.Error, match=r"holds a run already \(result\.json, .*name another folder"):
            session.run(CARRY, tmp_path / "run")
        session.load(CARRY.replace("carry", "home"))
        before = session.robot.clock.now()
        assert session.tick() == RUNNING
        assert session.robot.clock.now() - before == pytest.approx(0.05)
        statuses = [session.tick() for _ in range(200)]
        assert SUCCESS in statuses
    for use in (session.tick, lambda: session.run(CARRY)):
        with pytest.raises(NotConnectedError, match="the session has ended"):
            use()


def test_a_tree_that_was_loaded_keeps_the_entries_that_its_user_has_set() -> None:
    text = CARRY.replace('"carry"', '"{object}"')
    with bt.Session(task="pick_place_table", seed=3) as session:
        tree = session.load(text)
        assert tree.blackboard["object"] == "can"
        tree.blackboard["object"] = "carry"
        assert session.run(tree).tree_status == "SUCCESS"


@pytest.mark.slow
def test_a_shipped_tree_is_judged_by_the_goal_of_its_task_and_the_audit_is_of_the_session() -> None:
    with bt.Session(robot="bench_arm", scene="bench", seed=1) as session:
        first = session.run(CARRY)
        result = session.run(bt.load_tree("pick_bench"))
        assert (first.judged, result.judged, result.success, result.held_at_start) == (False, True, True, False)
        assert result.metrics["place_error_mm"] < 20.0
        again = session.run("pick_bench")
        assert again.held_at_start
        assert again.audit["collisions"] == 0


def test_numbers_that_an_evaluation_cannot_have_are_refused_at_once() -> None:
    with pytest.raises(bt.Error) as error:
        bt.evaluate("fetch_cop", episodes=0, seed=-1, jobs=0, scene="kichen")
    told = [
        "episodes: should be at least 1, got 0",
        "seed: should be at least 0, got -1",
        "jobs: should be at least 1, got 0",
        "fetch_cop: unknown task 'fetch_cop'; did you mean 'fetch_cup'?",
        "scene='kichen': unknown scene 'kichen'; did you mean 'kitchen'?",
    ]
    assert str(error.value).splitlines() == told
    assert {"Session", "evaluate", "load_tree", "nodes", "plan"} <= set(dir(bt))


@pytest.mark.slow
def test_an_evaluation_goes_on_where_it_stopped(tmp_path: Path) -> None:
    document = bt.evaluate("policy_reach", episodes=1, seed=5, folder=tmp_path)
    again = bt.evaluate("policy_reach", episodes=2, seed=5, folder=tmp_path)
    assert (document["episodes"], again["episodes"]) == (1, 2)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) >= 2
    with pytest.raises(bt.Error, match="unknown"):
        bt.evaluate("no_such_task")
