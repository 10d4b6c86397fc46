"""Whoever plans and follows, base and arm press on nothing that stands: a few of the benchmark's drives."""

from __future__ import annotations

import pytest

from benchmarks.hostile_drives import MOST_FORCE, ROOMS, room_drives

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("stretched", [False, True], ids=["arm at home", "arm ahead"])
def test_no_hostile_follower_presses_on_what_stands(stretched: bool) -> None:
    drives = room_drives(*ROOMS[0], count=6, stretched=stretched)
    assert [drive for drive in drives if drive["force_n"] > MOST_FORCE] == []
    assert sum(drive["driven_m"] for drive in drives) > 2.0


def test_a_column_does_not_jam_under_the_top_of_a_table_whose_legs_alone_the_lidar_sees() -> None:
    """The third drive of this room is an arc under its table: the base of the arm was pressed with 6,057 N."""
    drives = room_drives("dining_room", 3, count=3)
    assert [drive for drive in drives if drive["force_n"] > MOST_FORCE] == []
    assert drives[2]["driven_m"] > 0.5
