from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.messages import Pose
from bestman_bt.world_model.openness import articulation_called, openness_of
from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged

DRAWER = "drawer_chest/drawer_3"


def end_of(goal: str, opened: float = 0.0, **held: tuple[str, ...]) -> ScriptedEnd:
    """A room with a chest that stands askew and a cup on a table, at the end of a plan for ``goal``.

    ``opened``: metres of the upper drawer. ``held``: objects in the hand and what they touch beside it.
    """
    end = ScriptedEnd(
        "plan_put_away", "scene.furniture.drawer_chest.at=[1.4, 0.3, 115 deg]", told=(f"goals.0.facts.goal={goal}",)
    )
    end.truth.opened[DRAWER] = opened
    end.truth.on["cup"] = ("table",)
    for name, touching in held.items():
        end.truth.touched.add(name)
        end.truth.on[name] = touching
    return end


def put_in_drawer(end: ScriptedEnd, drawer: str = DRAWER, upright: bool = True) -> ScriptedEnd:
    """The cup in the middle of a drawer, which is open as far as it is."""
    piece = next(piece for piece in end.setup.world.furniture if piece.name == "drawer_chest")
    out = -end.truth.opened.get(drawer, 0.0) * piece.pose.rotation[:, 0]
    roll = 0.0 if upright else np.pi / 2
    pose = end.surface(drawer) @ Pose.from_xyz_rpy((0.0, 0.0, 0.05), (roll, 0.0, 0.0))
    end.put("cup", Pose(pose.position + out, pose.quaternion), "drawer_chest")
    return end


def says(end: ScriptedEnd) -> str:
    """What keeps the goal from being true; empty where it is."""
    verdict = end.verdict("facts")
    assert verdict.holds is (verdict.why == "")
    return verdict.why


@pytest.mark.slow
def test_what_stands_where_the_goal_says_is_there(tmp_path: Path) -> None:
    """In physics, whatever the tree has done."""
    goal = {"goal": "on(cup, table) and closed(drawer_3) and hand_empty"}
    result = judged(tmp_path, {"scene": "put_away", "goals": [{"facts": goal}], "predicate": "facts"}, Staged())
    assert result.predicate is True
    assert result.metrics == {"facts_judged": 3, "facts_share": 1.0}


def test_a_fact_that_cannot_be_judged_leaves_the_others_to_the_judge() -> None:
    verdict = end_of(f"on(cup, {DRAWER}) and located(cup)").verdict("facts")
    assert "not on" in verdict.why
    assert verdict.metrics == {"facts_judged": 1, "facts_share": 0.0}


def test_each_fact_that_is_not_true_is_reported() -> None:
    verdict = end_of(f"on(cup, {DRAWER}) and open(drawer_3) and hand_empty").verdict("facts")
    assert verdict.why == f"the cup is not on {DRAWER}, not standing on the drawer_chest; the {DRAWER} is not open"
    assert not verdict.holds
    assert verdict.metrics["facts_share"] == pytest.approx(1 / 3)


def test_a_drawer_is_open_from_where_skills_can_work_in_it_and_shut_up_to_a_centimetre() -> None:
    leaf = openness_of(articulation_called(end_of("hand_empty").setup.world_model, DRAWER))
    for opened, is_open, is_shut in (
        (0.0, False, True),
        (leaf.shut - 1e-4, False, True),
        (leaf.shut + 1e-4, False, False),
        (leaf.enough - 1e-4, False, False),
        (leaf.enough + 1e-4, True, False),
    ):
        assert says(end_of("open(drawer_3)", opened)) == ("" if is_open else f"the {DRAWER} is not open")
        assert says(end_of("not open(drawer_3)", opened)) == (f"the {DRAWER} is open" if is_open else "")
        assert says(end_of("closed(drawer_3)", opened)) == ("" if is_shut else f"the {DRAWER} is not shut")
        assert says(end_of("not closed(drawer_3)", opened)) == (f"the {DRAWER} is shut" if is_shut else "")


@pytest.mark.parametrize("opened", [0.0, 0.3])
def test_what_is_in_a_drawer_has_gone_with_it_and_may_lie_there_but_on_a_table_it_stands(opened: float) -> None:
    goal = f"on(cup, {DRAWER})"
    assert says(put_in_drawer(end_of(goal, opened))) == ""
    assert says(put_in_drawer(end_of(goal, opened), upright=False)) == ""
    left_behind = put_in_drawer(end_of(goal, 0.0))
    left_behind.truth.opened[DRAWER] = 0.3
    assert says(left_behind) == f"the cup is not on {DRAWER}"
    lying = Pose.from_xyz_rpy((0.0, 0.0, 0.0335), (np.pi / 2, 0.0, 0.0))
    for goal, words in (
        ("on(cup, table)", "the cup is tilted by 90°"),
        ("not on(cup, table)", "the cup is on table/top"),
    ):
        end = end_of(goal)
        end.put("cup", end.surface("table/top") @ lying, "table")
        assert says(end) == words


def test_a_thing_is_off_a_surface_only_where_it_is_held_or_elsewhere() -> None:
    on_top = "not on(cup, drawer_chest/top)"
    assert says(end_of("not on(cup, table)")) == "the cup is on table/top"
    assert says(put_in_drawer(end_of("not on(cup, table)"))) == ""
    assert says(put_in_drawer(end_of(on_top))) == "", "what is in a drawer is not on the top of the same chest"
    assert says(end_of("not on(cup, table)", cup=())) == "", "what is held above the table is not on it"
    assert says(end_of("not on(cup, table)", cup=("table",))) == "the cup is on table/top"
    leaning = end_of(on_top)
    pose = leaning.surface("drawer_chest/top")
    leaning.put("cup", pose @ Pose(np.array([-0.6, 0.0, -0.3])), "drawer_chest")
    assert says(leaning) == "the cup touches the drawer_chest"


@pytest.mark.parametrize(
    ("goal", "touching", "told"),
    [
        ("holding(cup)", None, "the cup is not in the hand"),
        ("holding(cup)", (), ""),
        ("holding(cup)", ("table",), "the cup is not in the hand"),
        ("not holding(cup)", None, ""),
        ("not holding(cup)", (), "the hand holds the cup"),
        ("not holding(cup)", ("table",), "the robot presses on the cup"),
        ("hand_empty", None, ""),
        ("hand_empty", (), "the hand holds the cup"),
        ("hand_empty", ("table",), "the robot presses on the cup"),
        ("not hand_empty", None, "the hand holds nothing"),
        ("not hand_empty", (), ""),
        ("not hand_empty", ("table",), "the hand holds nothing"),
    ],
)
def test_the_hand_holds_what_it_touches_and_nothing_else_bears(
    goal: str, touching: tuple[str, ...] | None, told: str
) -> None:
    assert says(end_of(goal, **({} if touching is None else {"cup": touching}))) == told


def test_of_a_thing_that_is_not_there_only_what_shall_not_be_is_true() -> None:
    for goal, told in (
        ("on(cup, table)", "there is no cup in the scene"),
        ("holding(cup)", "there is no cup in the scene"),
        ("not on(cup, table)", ""),
        ("not holding(cup)", ""),
    ):
        end = end_of(goal)
        assert end.verdict("facts", dataclasses.replace(end.evidence(), before={})).why == told


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
        ({"goal": "on(cup, table)", "given_places": {"cup": "tabel"}}, "did you mean 'table'?"),
        ({"goal": "on(cup, table)", "given_places": {"mugg": "table"}}, "the robot does not know an object 'mugg'"),
        ({"goal": "on(cup, table)", "replans": -1}, "replans"),
    ],
)
def test_a_bad_plan_is_refused_before_anything_starts(tmp_path: Path, plan: dict[str, Any], told: str) -> None:
    task = tmp_path / "bad.yaml"
    given = {"tree": "plan_and_execute", "robot": "diff_panda", "scene": "put_away", "predicate": "facts"}
    task.write_text(yaml.safe_dump({**given, "goals": [{"facts": plan}]}))
    with pytest.raises(ConfigurationError) as refusal:
        prepare_episode(load_run(task, seed=1))
    assert told in str(refusal.value)
    assert "bad.yaml" in str(refusal.value)
