"""Control experiments: where the task cannot be done, the fetch fails, and says in words what was in its way."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_root
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.result import Outcome, RunResult
from tests.behaviours.at_the_table import AT_THE_TABLE

pytestmark = pytest.mark.slow


@pytest.fixture
def without_retries(tmp_path: Path) -> Path:
    """The shipped tree, but everything is tried once."""
    attempts = 0
    for name in ("fetch_cup.xml", "subtrees/pick_and_place.xml"):
        once, count = re.subn(r'num_attempts="\d+"', 'num_attempts="1"', (data_root() / "trees" / name).read_text())
        attempts += count
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(once)
    assert attempts >= 4
    return tmp_path / "fetch_cup.xml"


@pytest.fixture(params=["mujoco", "pybullet"])
def driver(request: pytest.FixtureRequest) -> str:
    pytest.importorskip(request.param, reason=f"{request.param} is not installed")
    return str(request.param)


def assert_failed(result: RunResult, node: str, code: str) -> str:
    """The tree says that it failed, at this leaf; nothing was faked. Returns why."""
    assert (result.tree_status, result.outcome, result.success) == ("FAILURE", Outcome.FAILURE, False)
    assert result.failure is not None
    assert result.failure.node.split("/")[-1].split("::")[0] == node
    assert result.failure.error_code == code
    assert all(result.audit[cheat] == 0 for cheat in ("teleports", "grasp_constraints", "ground_truth_reads"))
    return result.failure.why


def test_with_slippery_fingers_the_grasp_fails_and_the_tree_reports_it(without_retries: Path, driver: str) -> None:
    settings = [*AT_THE_TABLE, "scene.finger_friction=0.05"]
    config = load_run("fetch_cup", tree=without_retries, seed=1, settings=settings, driver=driver)
    why = assert_failed(run_episode(config), "Grasp", "grasp_failed")
    assert "the hand closed but does not hold the cup: it closed to " in why


@pytest.mark.parametrize("task", ["fetch_cup", "pick_place_table", "push_object"])
def test_where_nothing_is_in_the_way_it_succeeds_in_mujoco_too(task: str) -> None:
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    result = run_episode(load_run(task, seed=2, settings=AT_THE_TABLE if task == "fetch_cup" else (), driver="mujoco"))
    assert result.success, result.failure
    assert all(result.audit[cheat] == 0 for cheat in CHEATS)
    assert result.metrics["place_error_mm"] < 15.0


def test_without_a_cup_the_shipped_tree_gives_up_and_reports_what_it_saw_instead() -> None:
    config = load_run("fetch_cup", seed=1, settings=[*AT_THE_TABLE, "scene.objects.cup=absent"])
    why = assert_failed(run_episode(config), "DetectObject", "not_found")
    assert why.startswith("no cup on the table: seen ")
    assert "can" in why


def test_on_a_covered_counter_no_free_disc_is_found(without_retries: Path) -> None:
    config = load_run("fetch_cup", tree=without_retries, scene="kitchen_covered_counter", seed=1, settings=AT_THE_TABLE)
    why = assert_failed(run_episode(config), "FindPlacePose", "surface_full")
    assert why == "no free 12 cm disc is left on the counter"
