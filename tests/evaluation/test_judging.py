"""The judge looks at the truth, whatever the tree says; a success needs both."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation import episode, judge
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.messages import Pose
from bestman_bt.monitor.groot2.hooks import Groot2Hooks
from bestman_bt.runtime.executor import Execution, TerminationReason
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.audit_record import ContactIncident, DisturbanceEvent
from hal.simulation.robot import SimulatedRobot

COUNTER_AS_MAPPED = ("scene.furniture.counter.offset=0", "scene.furniture.counter.turn=0")
GOAL_IN_THE_MIDDLE = (
    "scene.goals.place.region.x=[-0.12, -0.12]",
    "scene.goals.place.region.y=[0, 0]",
    "scene.goals.place.clearance=null",
)


def judged(leaf: str, folder: Path, *settings: str) -> RunResult:
    """Run a tree of one leaf where the goal is 12 cm before the middle of the counter."""
    tree = folder / "tree.xml"
    tree.write_text(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{leaf}</BehaviorTree></root>')
    return run_episode(
        load_run("fetch_cup", tree=tree, seed=1, settings=[*COUNTER_AS_MAPPED, *GOAL_IN_THE_MIDDLE, *settings])
    )


NATIVE_TREE = """
import py_trees

from bestman_bt.engine import Inverter, Sequence


class Full(py_trees.behaviour.Behaviour):
    def update(self):
        self.feedback_message = "the hand holds the cup already"
        return py_trees.common.Status.FAILURE


def build():
"""


def cup_at(x: float, y: float) -> tuple[str, ...]:
    """The cup stands on the counter from the beginning."""
    return (
        "scene.objects.cup.surface=counter/top",
        f"scene.objects.cup.region.x=[{x}, {x}]",
        f"scene.objects.cup.region.y=[{y}, {y}]",
        "scene.objects.counter_can=absent",
        "scene.objects.counter_box=absent",
    )


def test_what_falls_during_the_rest_time_is_judged_by_where_it_was_before(monkeypatch: pytest.MonkeyPatch) -> None:
    place, slept = Pose(np.array([0.3, 0.2, 0.9])), list[float]()

    class Falls:
        """A clock, and what is true: the cup falls while time passes."""

        object_names = ("cup",)

        def object_pose(self, name: str) -> Pose:
            return Pose(place.position - np.array([0.0, 0.0, sum(slept)]))

        def sleep(self, seconds: float) -> None:
            slept.append(seconds)

    task = SimpleNamespace(predicates=("placed",), tolerances=SimpleNamespace(rest_time=0.5))
    models = SimpleNamespace(of=lambda kind: {})
    setup = SimpleNamespace(subjects=("cup", "can"), asked=(), robot_model=models, config=SimpleNamespace(task=task))
    seen = list[Evidence]()
    monkeypatch.setattr(
        "bestman_bt.evaluation.judge.judged", lambda goals, name, one: seen.append(one) or Verdict(True)
    )
    for clock in (Falls(), None):
        slept.clear()
        judge.judge_session(SimpleNamespace(setup=setup), Falls(), clock, 1.5)
        np.testing.assert_array_equal(seen[-1].before["cup"], place.position)
        assert (list(seen[-1].before), seen[-1].driven, slept) == (["cup"], 1.5, [0.5] if clock else [])


def test_a_cup_at_its_goal_and_a_tree_that_succeeds_are_a_success(tmp_path: Path) -> None:
    result = judged("<AlwaysSuccess/>", tmp_path, *cup_at(-0.12, 0.0))
    assert (result.success, result.outcome, result.predicate, result.failure) == (True, Outcome.SUCCESS, True, None)
    assert result.metrics["place_error_mm"] == pytest.approx(0.0, abs=0.5)
    assert result.metrics["tilt_deg"] == pytest.approx(0.0, abs=0.1)
    assert (result.held_at_start, result.unearned) == (True, "the goal held before the run began")


def test_a_tree_that_fails_is_no_success_even_where_the_cup_is_at_its_goal(tmp_path: Path) -> None:
    result = judged("<AlwaysFailure/>", tmp_path, *cup_at(-0.12, 0.0))
    assert (result.success, result.outcome, result.predicate) == (False, Outcome.FAILURE, True)
    assert result.failure is not None
    assert result.failure.why == "AlwaysFailure failed and gave no reason"
    assert result.failure.named == "AlwaysFailure (tree.xml:1)"


@pytest.mark.parametrize(
    ("build", "path", "why"),
    [
        ('py_trees.behaviours.Failure("no can in sight")', "no can in sight", "failure"),
        (
            'Sequence("work", [py_trees.behaviours.Success("one"), Full("hand")])',
            "hand",
            "the hand holds the cup already",
        ),
        (
            'Inverter("never", [py_trees.behaviours.Success("one")])',
            "",
            "the tree failed, though none of its leaves did",
        ),
    ],
)
def test_a_native_leaf_that_fails_is_named_with_its_feedback(tmp_path: Path, build: str, path: str, why: str) -> None:
    tree = tmp_path / "native.py"
    tree.write_text(NATIVE_TREE + f"    return {build}\n")
    result = run_episode(load_run("fetch_cup", tree=tree, seed=1))
    assert result.failure is not None
    assert (result.failure.node, result.failure.error_code, result.failure.why) == (path, "tree_failed", why)


@pytest.mark.parametrize(("off", "success"), [(0.018, True), (0.022, False)])
def test_two_centimetres_are_near_enough(tmp_path: Path, off: float, success: bool) -> None:
    result = judged("<AlwaysSuccess/>", tmp_path, *cup_at(-0.12, off))
    assert result.success is success
    assert result.metrics["place_error_mm"] == pytest.approx(1e3 * off, abs=0.5)
    assert (result.failure is None) is success
    if result.failure is not None:
        assert result.failure.why == "the cup is 22 mm from the goal"


def test_a_cup_that_was_left_where_it_was_is_judged_in_words(tmp_path: Path) -> None:
    result = judged("<AlwaysSuccess/>", tmp_path)
    assert result.tree_status == "SUCCESS"
    assert not result.success
    assert result.held_at_start is False
    assert result.failure is not None
    assert (result.failure.node, result.failure.error_code) == ("judge", "predicate")
    assert "mm from the goal, not standing on the counter" in result.failure.why


FINGERS = ContactIncident("panda_leftfinger", "can", ("fingers", "object"), 2.0, 3.0, 9.0)
ON_THE_CHEST = replace(FINGERS, second="drawer_chest", kinds=("fingers", "furniture"))
DRAWER = "drawer_chest/drawer_3"


@cache
def prepared(task: str) -> ResolvedConfig:
    return episode.prepare_episode(load_run(task, seed=1))


@pytest.mark.parametrize(
    ("task", "contact", "moved"),
    [
        ("fetch_cup", FINGERS, ["cup"]),
        ("fetch_cup", replace(FINGERS, second="cup"), []),
        ("fetch_cup", replace(FINGERS, first="cup", second="table", kinds=("object", "furniture")), []),  # in the hand
        ("open_drawer", replace(ON_THE_CHEST, articulation="drawer_chest/drawer_1"), [DRAWER]),
        ("open_drawer", replace(ON_THE_CHEST, articulation=DRAWER), []),
    ],
)
def test_what_somebody_else_moved_and_the_robot_or_what_it_held_never_touched_is_reported(
    task: str, contact: ContactIncident, moved: list[str]
) -> None:
    setup = prepared(task)
    events = [DisturbanceEvent(1.0, 1.0, "put", name, "") for name in ("cup", "can", DRAWER)]
    record: Any = SimpleNamespace(contacts=(contact,))
    assert episode.moved_by_others(setup, events, record) == moved


def test_a_tolerance_larger_than_the_scene_is_refused_with_its_line(tmp_path: Path) -> None:
    task = tmp_path / "mine.yaml"
    shipped = find_data("task", "fetch_cup").read_text(encoding="utf-8")
    task.write_text(shipped.replace("position: 2 cm", "position: 10 m"))
    line = 1 + task.read_text().splitlines().index("tolerances: {position: 10 m, tilt: 10 deg, rest_time: 1 s}")
    with pytest.raises(ConfigurationError, match=rf"mine.yaml:{line}: tolerances.position: .*, 9.0 m, got 10 m"):
        episode.prepare_episode(load_run(task, seed=1))


def test_a_scene_without_the_cup_cannot_be_a_success(tmp_path: Path) -> None:
    result = judged("<AlwaysSuccess/>", tmp_path, "scene.objects.cup=absent")
    assert not result.success
    assert result.failure is not None
    assert result.failure.why == "there is no cup in the scene"


@pytest.mark.slow
def test_a_run_that_takes_too_long_has_failed(tmp_path: Path) -> None:
    result = judged('<NavigateTo goal="1.5;-0.4;0"/>', tmp_path, "time_limit=1 s")
    assert (result.outcome, result.tree_status) == (Outcome.FAILURE, "IDLE")
    assert result.failure is not None
    assert (result.failure.error_code, result.failure.why) == ("timeout", "not done within 1 s")


def test_too_deep_a_contact_fails_a_run_that_was_a_success_otherwise(tmp_path: Path) -> None:
    result = judged("<AlwaysSuccess/>", tmp_path, *cup_at(-0.12, 0.0), "max_penetration=0.001 mm")
    assert (result.tree_status, result.predicate, result.success) == ("SUCCESS", True, False)
    assert result.failure is not None
    assert result.failure.node == "audit"
    assert "overlap by" in result.failure.why


LEAVES = '''
import os
import signal

from behaviours.skill import InstantSkill, SkillFailure
from bestman_bt.engine import RUNNING, StatefulAction


class Fail(InstantSkill):
    """Fails with its own name."""

    def act(self) -> None:
        raise SkillFailure(f"code_of_{self.name}", f"words of {self.name}")


class Stop(StatefulAction):
    """Asks for the end of the run."""

    def on_start(self) -> int:
        os.kill(os.getpid(), signal.SIGINT)
        return RUNNING

    def on_running(self) -> int:
        return RUNNING
'''


def with_leaves(folder: Path, leaf: str, *settings: str) -> RunResult:
    (folder / "leaves.py").write_text(LEAVES)
    return judged(leaf, folder, f"plugins=[{folder / 'leaves.py'}]", *settings)


def test_of_several_failures_the_last_one_is_to_blame(tmp_path: Path) -> None:
    result = with_leaves(tmp_path, '<Fallback><Fail name="first"/><Fail name="second"/></Fallback>')
    assert result.failure is not None
    assert (result.failure.error_code, result.failure.why) == ("code_of_second", "words of second")
    assert result.failure.node.endswith("second")


def test_a_run_that_somebody_stops_is_cancelled_and_not_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stops: list[float] = []
    stop = SimulatedRobot.stop

    def noted(robot: SimulatedRobot) -> None:
        stops.append(robot.clock.now())
        stop(robot)

    monkeypatch.setattr(SimulatedRobot, "stop", noted)
    result = with_leaves(tmp_path, "<Stop/>", *cup_at(-0.12, 0.0))
    assert stops[-1] - stops[0] == pytest.approx(0.5, abs=0.01), "stopped at once, not only when the session ends"
    assert (result.outcome, result.success, result.predicate, result.metrics) == (Outcome.CANCELLED, False, None, {})
    assert result.failure is not None
    assert result.failure.error_code == "cancelled"
    assert result.audit["teleports"] == 0


@pytest.mark.parametrize(
    ("ending", "outcome"),
    [
        (TerminationReason.FINISHED, Outcome.SUCCESS),
        (TerminationReason.TIMEOUT, Outcome.FAILURE),
        (TerminationReason.CANCELLED, Outcome.CANCELLED),
        (TerminationReason.ERROR, Outcome.ERROR),
    ],
)
def test_how_an_execution_ended_decides_the_outcome(ending: TerminationReason, outcome: Outcome) -> None:
    config = load_run("fetch_cup", seed=1)
    session: Any = SimpleNamespace(setup=SimpleNamespace(config=config), skills=SimpleNamespace(failures=[]))
    status = "SUCCESS" if ending is TerminationReason.FINISHED else "IDLE"
    result = episode.judged_result(session, Execution(ending, status, 3, 1.0, 2.0, "so it was"), None, None, 2.0)
    assert (result.outcome, result.success) == (outcome, outcome is Outcome.SUCCESS)
    told = None if result.failure is None else (result.failure.error_code, result.failure.why)
    assert told == (None if ending is TerminationReason.FINISHED else (str(ending), "so it was"))


def test_a_run_that_nobody_judges_succeeds_with_its_tree_but_not_with_a_cheat(tmp_path: Path) -> None:
    assert judged("<AlwaysSuccess/>", tmp_path, "predicate=null").success
    tree = tmp_path / "tree.xml"

    def cheat(session: RobotSession, _: Tree) -> Callable[[], None]:
        simulation = session.robot.simulation
        cup = simulation.built.objects["cup"]
        return lambda: simulation.engine.put(cup, *simulation.engine.body_pose(cup))

    config = load_run("fetch_cup", tree=tree, seed=1, settings=["predicate=null"])
    result = run_episode(config, watch=cheat)
    assert (result.tree_status, result.predicate, result.success) == ("SUCCESS", None, False)
    assert result.failure is not None
    assert (result.failure.node, result.failure.error_code) == ("audit", "audit")
    assert "put was called" in result.failure.why.partition(";")[2]


def test_what_somebody_forces_by_groot2_while_a_run_is_judged_stands_in_its_result(tmp_path: Path) -> None:
    path = tmp_path / "tree.xml"
    path.write_text('<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysFailure name="leaf"/></BehaviorTree></root>')

    def force(session: RobotSession, tree: Tree) -> Callable[[], None]:
        hooks = Groot2Hooks(tree, lambda uid: None, session.intervened)
        once = {"uid": 1, "position": 1, "mode": 1, "once": True, "enabled": True, "desired_status": "SUCCESS"}
        hooks.insert(json.dumps(once).encode())
        return lambda: None

    result = run_episode(load_run("fetch_cup", tree=path, seed=1, settings=["predicate=null"]), watch=force)
    assert result.success
    assert [mark.partition(" s: ")[2] for mark in result.interventions] == ["leaf was forced to return SUCCESS"]
    assert "a person intervened" in result.unearned
