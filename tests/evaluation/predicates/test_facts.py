from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from bestman_bt.configuration import ConfigurationError, load_run
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.predicates.facts import facts
from bestman_bt.evaluation.predicates.verdict import Evidence
from bestman_bt.messages import Pose
from bestman_bt.runtime import Session
from bestman_bt.task_planning.symbolic import parse_goal
from tests.evaluation.predicates.staged import Staged, judged, why

DRAWER = "drawer_chest/drawer_3"


def asked(goal: str, **more: object) -> dict[str, Any]:
    """A task that wants facts, in a room with a cup on a table and a chest of drawers."""
    return {"scene": "put_away", "plan": {"goal": goal, **more}, "predicate": "facts"}


def in_drawer(opened: float, upright: bool = True) -> Staged:
    """The cup in the middle of the top drawer, which is open so far."""

    def where(session: Session) -> Pose:
        chest = next(p for p in session.setup.world.furniture if p.name == "drawer_chest")
        surface = next(s for s in chest.model.all_surfaces if s.name == "drawer_3")
        tilted = Pose.from_xyz_rpy((0.0, 0.0, 0.0501 if upright else 0.0335), (0.0 if upright else np.pi / 2, 0.0, 0.0))
        return chest.pose @ Pose(np.array([-opened, 0.0, 0.0])) @ surface.pose @ tilted

    return Staged(opened={DRAWER: opened}, moved={"cup": where})


def test_what_stands_where_the_goal_says_is_there(tmp_path: Path) -> None:
    result = judged(tmp_path, asked("on(cup, table) and closed(drawer_3) and hand_empty"), Staged())
    assert result.predicate is True
    assert result.metrics == {"facts_judged": 3, "facts_share": 1.0}


def test_a_fact_that_cannot_be_judged_leaves_the_others_to_the_judge(tmp_path: Path) -> None:
    result = judged(tmp_path, asked(f"on(cup, {DRAWER}) and tucked"), Staged())
    assert "not on" in why(result)
    assert result.metrics == {"facts_judged": 1, "facts_share": 0.0}


def test_each_fact_that_is_not_true_is_told(tmp_path: Path) -> None:
    result = judged(tmp_path, asked(f"on(cup, {DRAWER}) and open(drawer_3) and hand_empty"), Staged())
    assert why(result) == (f"the cup is not on {DRAWER}, not standing on the drawer_chest; the {DRAWER} is not open")
    assert result.metrics["facts_share"] == pytest.approx(1 / 3, abs=1e-4)


@pytest.mark.parametrize(("opened", "holds"), [(0.0, True), (0.3, False)])
def test_the_drawer_has_to_be_shut_where_that_is_asked(tmp_path: Path, opened: float, holds: bool) -> None:
    result = judged(tmp_path, asked(f"on(cup, {DRAWER}) and closed(drawer_3)"), in_drawer(opened))
    assert result.predicate is holds


def test_in_a_drawer_things_may_lie_on_a_table_they_stand(tmp_path: Path) -> None:
    assert judged(tmp_path, asked(f"on(cup, {DRAWER})"), in_drawer(0.3, upright=False)).predicate is True

    def lying(session: Session) -> Pose:
        table = next(p for p in session.setup.world.furniture if p.name == "table")
        return table.pose @ table.model.all_surfaces[0].pose @ Pose.from_xyz_rpy((0.0, 0.0, 0.0335), (np.pi / 2, 0, 0))

    told = why(judged(tmp_path, asked("on(cup, table)"), Staged(moved={"cup": lying})))
    assert "tilted by 90°" in told
    told = why(judged(tmp_path, asked("not on(cup, table)"), Staged(moved={"cup": lying})))
    assert told == "the cup is on table/top"


def test_what_shall_not_be_is_judged_too(tmp_path: Path) -> None:
    assert judged(tmp_path, asked("not on(cup, table)"), in_drawer(0.0)).predicate is True
    assert why(judged(tmp_path, asked("not on(cup, table)"), Staged())) == "the cup is on table/top"
    assert why(judged(tmp_path, asked("not closed(drawer_3)"), Staged())) == f"the {DRAWER} is shut"
    assert why(judged(tmp_path, asked("not open(drawer_3)"), in_drawer(0.3))) == f"the {DRAWER} is open"


def test_what_is_in_a_drawer_is_not_on_the_top_of_the_same_chest(tmp_path: Path) -> None:
    assert judged(tmp_path, asked("not on(cup, drawer_chest/top)"), in_drawer(0.0)).predicate is True


@pytest.mark.parametrize("goal", ["not holding(cup)", "hand_empty"])
def test_the_hand_is_not_empty_while_the_robot_presses_on_what_stands(tmp_path: Path, goal: str) -> None:
    assert judged(tmp_path, asked(goal), Staged()).predicate is True
    truth = SimpleNamespace(object_names=("cup",), touches_robot=lambda _: True, supports=lambda _: ("table",))
    session = SimpleNamespace(setup=SimpleNamespace(plan_goal=parse_goal(goal)))
    assert facts(Evidence(session, truth, {"cup": (0.0, 0.0, 0.0)})).why == "the robot presses on the cup"  # type: ignore[arg-type]


def test_what_the_hand_does_not_hold_is_not_held(tmp_path: Path) -> None:
    assert why(judged(tmp_path, asked("holding(cup)"), Staged())) == "the cup is not in the hand"


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ({"goal": "located(cup)"}, "located(cup) cannot be judged"),
        ({"goal": ""}, "the goal is empty"),
        ({"goal": " "}, "the goal is empty"),
        ({"goal": "on(cupp, table)"}, "did you mean 'cup'?"),
        ({"goal": "on(cup"}, "column"),
        ({"goal": "on(cup, table)", "builder": "reactiv"}, "did you mean 'reactive'?"),
        ({"goal": "on(cup, table)", "planner": "symbolc"}, "did you mean 'symbolic'?"),
        ({"goal": "on(cup, table)", "limits": "stepps=3"}, "steps"),
        ({"goal": "on(cup, table)", "told": {"cup": "tabel"}}, "did you mean 'table'?"),
        ({"goal": "on(cup, table)", "told": {"mugg": "table"}}, "the robot knows no object 'mugg'"),
        ({"goal": "on(cup, table)", "replans": -1}, "replans"),
    ],
)
def test_a_bad_plan_is_refused_before_anything_starts(tmp_path: Path, plan: dict[str, Any], told: str) -> None:
    task = tmp_path / "bad.yaml"
    given = {"tree": "plan_and_execute", "robot": "diff_panda", "scene": "put_away", "predicate": "facts", "plan": plan}
    task.write_text(yaml.safe_dump(given))
    with pytest.raises(ConfigurationError) as refusal:
        prepare_episode(load_run(task, seed=1))
    assert told in str(refusal.value)
    assert "bad.yaml" in str(refusal.value)
