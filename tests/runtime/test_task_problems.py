"""A task is checked against its scene before anything starts, and its tree is told what it asks for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunRequest, load_run, run_of_options
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import open_session

TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
SET_TABLE = """\
scene: set_table
predicate: placed
goals:
  - {placed: {object: plate, at: place_plate, source: counter, surface: table}}
  - {placed: {object: fork, at: place_fork, source: counter, surface: table/top}}
"""
PUT_AWAY = """\
scene: put_away
predicate: [placed, opened]
goals:
  - {placed: {object: cup, at: place, source: table, surface: drawer_chest/drawer_3}}
  - {opened: {articulation: drawer_chest/drawer_3, at_most: 2 cm}}
"""
TIDY = """\
scene: untidy_table
predicate: tidied
goals:
  - {tidied: {objects: [cup, can], source: table, surface: counter/top, x: [-25 cm, 0], y: [-60 cm, 60 cm]}}
"""


def written(folder: Path, text: str) -> Path:
    (folder / "t.xml").write_text(TREE)
    path = folder / "task.yaml"
    path.write_text(f"tree: {folder}/t.xml\nrobot: diff_panda\n{text}")
    return path


def problems(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        prepare_episode(load_run(written(folder, text), seed=1))
    return [str(problem).rpartition("task.yaml:")[2] for problem in error.value.problems]


def test_every_unknown_name_is_reported_with_its_line_and_what_was_meant(tmp_path: Path) -> None:
    wrong = SET_TABLE.replace("place_fork", "place_frok").replace("object: plate", "object: plat")
    wrong = wrong.replace("table/top", "table/tpo")
    assert problems(tmp_path, wrong) == [
        "6: goals[0].placed.object: the robot knows no object 'plat'; did you mean 'plate'?",
        "7: goals[1].placed.at: the scene has no goal 'place_frok'; did you mean 'place_fork'?",
        "7: goals[1].placed.surface: the map has no surface 'table/tpo'; did you mean 'table/top'?",
    ]


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (
            PUT_AWAY,
            "articulation: drawer_chest/drawer_3",
            "articulation: drawer_chest/drawer_4",
            "7: goals[1].opened.articulation: the scene has no door or drawer 'drawer_chest/drawer_4'; did you mean",
        ),
        (PUT_AWAY, ", at_most: 2 cm", "", "7: goals[1].opened: one of 'at_least' and 'at_most' should be given"),
        (
            PUT_AWAY,
            "at_most: 2 cm",
            "at_least: 10 cm, at_most: 2 cm",
            "7: goals[1].opened.at_most: should not be less than at_least, 0.1, got 0.02",
        ),
        (PUT_AWAY, "at_most: 2 cm", "at_most: 2 kg", "7: goals[1].opened.at_most: expected an angle in rad"),
        (PUT_AWAY, "[placed, opened]", "[placed, opend]", "4: predicate[1]: unknown predicate 'opend'; did you mean"),
        (
            PUT_AWAY,
            "[placed, opened]",
            "[placed, tidied]",
            "5: goals: the predicate 'tidied' needs an entry {tidied: …}",
        ),
        (
            TIDY,
            "[cup, can]",
            "[cup, kan]",
            "6: goals[0].tidied.objects[1]: the robot knows no object 'kan'; did you mean 'can'?",
        ),
        (
            TIDY,
            "source: table",
            "source: tabel",
            "6: goals[0].tidied.source: the map has no surface 'tabel'; did you mean",
        ),
        (
            TIDY,
            "x: [-25 cm, 0]",
            "x: [0, -25 cm]",
            "6: goals[0].tidied.x: the smaller limit comes first: [-25 cm, 0], got [0, -25 cm]",
        ),
        (
            SET_TABLE,
            "predicate: placed",
            "predicate: placed\ngoal: {name: place_mug, object: mug, source: counter, surface: table}",
            "5: goal: is an entry of 'goals' now: write goals: [{placed: {object: mug, source: counter, ",
        ),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, text: str, old: str, new: str, message: str) -> None:
    assert old in text
    told = problems(tmp_path, text.replace(old, new))
    assert any(message in problem for problem in told), told


CONTACTS = """\
scene: kitchen
predicate: placed
goals:
  - {placed: {object: cup, at: place, source: table, surface: counter}}
allowed_contacts: [[fingers, box], [bx, table], [box, shelf]]
"""
CHOICE = """\
scene: pick_place_table
predicate: placed
goals:
  - {placed: {object: [can, box], at: place, source: table, surface: table}}
"""


def test_contacts_with_an_object_that_is_left_out_are_no_fault_but_misspelt_ones_are(tmp_path: Path) -> None:
    def told(*settings: str) -> list[str]:
        with pytest.raises(ConfigurationError) as error:
            prepare_episode(load_run(written(tmp_path, CONTACTS), seed=1, settings=settings))
        return [problem.field for problem in error.value.problems]

    assert told() == told("scene.objects.box=absent") == ["allowed_contacts[1][0]", "allowed_contacts[2][1]"]


def test_contacts_beside_one_of_a_wrong_type_are_checked_all_the_same(tmp_path: Path) -> None:
    wrong = CONTACTS.replace("[[fingers, box], [bx, table]", "[[fingers, 3], cup, [bx, table]")
    found: list[Problem] = []
    config = run_of_options(RunRequest(written(tmp_path, wrong), seed=1), found)
    with pytest.raises(ConfigurationError) as error:
        prepare_episode(config, found)
    fields = ["allowed_contacts[0][1]", "allowed_contacts[1]", "allowed_contacts[2][0]", "allowed_contacts[3][1]"]
    assert sorted(problem.field for problem in error.value.problems) == fields


def test_of_objects_to_choose_from_those_that_are_left_out_are_not_chosen(tmp_path: Path) -> None:
    task = written(tmp_path, CHOICE)
    for seed in range(6):
        setup = prepare(load_run(task, seed=seed, settings=["scene.objects.can=absent"]))
        assert [goal.object for goal in setup.goals] == ["box"]
    with pytest.raises(
        ConfigurationError, match=r"6: goals\[0\].placed.object: the scene leaves out all of these objects"
    ):
        prepare(load_run(task, settings=["scene.objects.can=absent", "scene.objects.box=absent"]))


OPENING = "scene: {scene}\npredicate: opened\ngoals: [{{opened: {{articulation: {name}, at_least: {asked}}}}}]\n"
DOOR, DRAWER = ("fridge_room", "fridge/upper_door"), ("chest_room", "drawer_chest/drawer_1")


@pytest.mark.parametrize(
    ("leaf", "asked", "told"),
    [
        (DOOR, "20 cm", "'fridge/upper_door' has a revolute joint: expected an angle in rad"),
        (DRAWER, "10 deg", "'drawer_chest/drawer_1' has a prismatic joint: expected a length in m"),
        (DOOR, "110 deg", "'fridge/upper_door' opens from 0 to 108.9 deg, got 110 deg"),
        (DRAWER, "33 cm", "'drawer_chest/drawer_1' opens from 0 to 32.8 cm, got 33 cm"),
    ],
)
def test_an_opening_is_asked_in_a_unit_of_its_joint_and_within_its_range(
    leaf: tuple[str, str], asked: str, told: str, tmp_path: Path
) -> None:
    (problem,) = problems(tmp_path, OPENING.format(scene=leaf[0], name=leaf[1], asked=asked))
    assert problem.startswith(f"5: goals[0].opened.at_least: {told}")


@pytest.mark.parametrize(
    ("leaf", "asked", "value"),
    [(DOOR, "90 deg", math.pi / 2), (DOOR, "1.2 rad", 1.2), (DRAWER, "250 mm", 0.25), (DRAWER, "0.3", 0.3)],
)
def test_an_opening_is_known_in_radians_or_metres(
    leaf: tuple[str, str], asked: str, value: float, tmp_path: Path
) -> None:
    path = written(tmp_path, OPENING.format(scene=leaf[0], name=leaf[1], asked=asked))
    opening = prepare(load_run(path, seed=1)).asked[0].asked
    assert opening.at_least == pytest.approx(value)


def test_the_tree_is_reported_each_goal_in_order(tmp_path: Path) -> None:
    with open_session(load_run(written(tmp_path, SET_TABLE), seed=1)) as session:
        goals, drawn = session.entries["goals"], session.setup.world.goals
        assert [(goal["object"], goal["target"]) for goal in goals] == [("plate", "table"), ("fork", "table/top")]
        assert [goal["goal"] for goal in goals] == [drawn["place_plate"], drawn["place_fork"]]
        assert session.entries["place_fork"] is drawn["place_fork"]


def test_the_tree_is_told_what_to_close_but_not_where_its_handle_is(tmp_path: Path) -> None:
    with open_session(load_run(written(tmp_path, PUT_AWAY), seed=1)) as session:
        entries = session.entries
        assert (entries["object"], entries["target"]) == ("cup", "drawer_chest/drawer_3")
        assert (entries["furniture"], entries["articulation"]) == ("drawer_chest", "drawer_chest/drawer_3")
        assert entries["at_most"] == pytest.approx(0.02)
        assert "at_least" not in entries
        assert not [name for name in entries if "handle" in name]
        assert session.skills.world.articulations == {}


def test_the_tree_is_told_what_to_tidy_and_where(tmp_path: Path) -> None:
    with open_session(load_run(written(tmp_path, TIDY), seed=1)) as session:
        assert session.entries["objects"] == ["cup", "can"]
        assert (session.entries["source"], session.entries["target"]) == ("table", "counter/top")
        np.testing.assert_allclose(session.entries["region_x"], [-0.25, 0.0])
