from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.runtime import Session
from tests.evaluation.predicates.staged import Staged, judged, why

PUT_AWAY = {
    "scene": "put_away",
    "goal": {"name": "place", "object": "cup", "source": "table", "surface": "drawer_chest/drawer_3"},
    "opening": {"articulation": "drawer_chest/drawer_3", "at_most": "2 cm"},
    "predicate": ["inside", "opened"],
}


def in_drawer(drawer: str, opened: float) -> Staged:
    """The cup in the middle of a drawer, which is open so far."""

    def where(session: Session) -> Pose:
        chest = next(p for p in session.setup.world.furniture if p.name == "drawer_chest")
        surface = next(s for s in chest.model.all_surfaces if s.name == drawer)
        return chest.pose @ Pose(np.array([-opened, 0.0, 0.0])) @ surface.pose @ Pose(np.array([0.0, 0.0, 0.0501]))

    return Staged(opened={f"drawer_chest/{drawer}": opened}, moved={"cup": where})


def test_a_cup_in_the_closed_drawer_is_put_away(tmp_path: Path) -> None:
    assert judged(tmp_path, PUT_AWAY, in_drawer("drawer_3", 0.0)).predicate is True


def test_a_cup_that_is_still_on_the_table_is_not(tmp_path: Path) -> None:
    told = why(judged(tmp_path, PUT_AWAY, Staged()))
    assert told == "the cup is not inside drawer_chest/drawer_3, not standing on the drawer_chest"


def test_the_drawer_has_to_be_closed(tmp_path: Path) -> None:
    told = why(judged(tmp_path, PUT_AWAY, in_drawer("drawer_3", 0.25)))
    assert told == "the drawer_chest/drawer_3 is open by 250.0 mm, at most 20 mm are asked"


def test_an_open_drawer_is_where_it_is_and_not_where_it_was(tmp_path: Path) -> None:
    either = {**PUT_AWAY, "predicate": "inside"}
    assert judged(tmp_path, either, in_drawer("drawer_3", 0.25)).predicate is True


@pytest.mark.parametrize("drawer", ["drawer_2", "top"])
def test_another_drawer_or_the_top_is_not_the_drawer(tmp_path: Path, drawer: str) -> None:
    end = in_drawer(drawer, 0.0)
    end = end if drawer != "top" else Staged(moved=end.moved)
    assert why(judged(tmp_path, PUT_AWAY, end)) == "the cup is not inside drawer_chest/drawer_3"
