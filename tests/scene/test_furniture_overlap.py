"""Furniture may touch, stack and reach under other furniture, but not stand in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.scene.load import load_scene

ROOM = """\
walls: {height: 1 m, thickness: 10 cm, lines: [[[-3, -3], [3, -3]]]}
objects: {}
robot_start: {x: [-2, -1], y: [-1, 1]}
furniture:
  table: {model: table, at: [1, 0, 0]}
"""


def told(folder: Path, *pieces: str) -> list[str]:
    """What is said about a room with a table, 80 cm deep and 120 cm wide at x = 1, and these pieces."""
    path = folder / "room.yaml"
    path.write_text(ROOM + "".join(f"  {piece}\n" for piece in pieces))
    try:
        load_scene(path)
    except ConfigurationError as error:
        return [str(problem).removeprefix(f"{path}:") for problem in error.problems]
    return []


def test_a_piece_in_another_is_reported_with_its_line_and_both_names(tmp_path: Path) -> None:
    assert told(tmp_path, "counter: {model: counter, at: [1.5, 0, 0]}") == [
        "6: furniture.counter.at: stands 18.5 cm deep in 'table'; furniture may touch or stand on other furniture"
    ]


def test_all_pairs_are_reported(tmp_path: Path) -> None:
    problems = told(tmp_path, "one: {model: table, at: [1.2, 0, 0]}", "two: {model: table, at: [1, 0.3, 0]}")
    assert [problem.partition(";")[0] for problem in problems] == [
        "6: furniture.one.at: stands 3.5 cm deep in 'table'",
        "7: furniture.two.at: stands 3.0 cm deep in 'table'",
        "7: furniture.two.at: stands 3.0 cm deep in 'one'",
    ]


@pytest.mark.parametrize(("x", "faults"), [(1.800, 0), (1.796, 0), (1.794, 1), (1.806, 0)])
def test_side_by_side_they_may_touch_with_five_millimetres_to_spare(tmp_path: Path, x: float, faults: int) -> None:
    assert len(told(tmp_path, f"other: {{model: table, at: [{x}, 0, 0]}}")) == faults


def test_turned_tables_are_compared_by_their_outlines_not_by_boxes_around_them(tmp_path: Path) -> None:
    # The corner of the turned one, (0.4 + 0.6) / sqrt(2) from its middle, comes to x = 1.4 where it stands at 2.107.
    assert told(tmp_path, "other: {model: table, at: [2.11, 0.1, 45 deg]}") == []
    assert len(told(tmp_path, "other: {model: table, at: [2.08, 0.1, 45 deg]}")) == 1


def test_stacked_is_not_overlapping_whichever_way_it_is_written(tmp_path: Path) -> None:
    assert told(tmp_path, "microwave: {model: microwave, on: table, at: [0, 0, 0]}") == []
    (problem,) = told(tmp_path, "microwave: {model: microwave, at: [1.3, 0.58, 0]}")  # on the floor, in a leg
    assert problem.startswith("6: furniture.microwave.at: stands ")


def test_what_stands_between_the_legs_of_a_table_is_not_in_it(tmp_path: Path) -> None:
    assert told(tmp_path, "microwave: {model: microwave, at: [1, 0, 0]}") == []


def test_a_drawer_that_stands_open_at_the_start_is_where_it_has_gone(tmp_path: Path) -> None:
    chest = "chest: {{model: drawer_chest, at: [1.9, 0, 0]{}}}"
    assert told(tmp_path, chest.format("")) == []
    (problem,) = told(tmp_path, chest.format(", open: {drawer_3: 30 cm}"))
    assert problem.startswith("6: furniture.chest.at: stands ")
    assert "in 'table'" in problem


@pytest.mark.quick_cases(10)
@pytest.mark.parametrize("name", data_names("scene"))
def test_no_shipped_scene_has_furniture_in_furniture(name: str) -> None:
    assert load_scene(name).name == name
