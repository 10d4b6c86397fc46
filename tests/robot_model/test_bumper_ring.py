"""The strips of a bumper: of equal length, all around the footprint."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from bestman_bt.robot_model.describe import mounted_bumper


def zones(count: int) -> tuple[tuple[tuple[float, float], tuple[float, float]], ...]:
    """Of a base 0.6 m long and 0.4 m wide, whose corners are told from the rear left one on."""
    corners = ((-0.3, 0.2), (-0.3, -0.2), (0.3, -0.2), (0.3, 0.2))
    base = SimpleNamespace(footprint=corners, wheel_joints=("left", "right"), steering_joints=())
    part = SimpleNamespace(frame="bumper", zones=count, threshold=5.0, height=0.1, rate=50.0, latency=0.0)
    return mounted_bumper(part, base).zones


def test_strips_go_counter_clockwise_from_the_front_right_corner() -> None:
    assert zones(2) == (((0.3, -0.2), (-0.3, 0.2)), ((-0.3, 0.2), (0.3, -0.2)))
    assert zones(5)[0] == ((0.3, -0.2), (0.3, 0.2))


@pytest.mark.parametrize("count", [1, 3, 8])
def test_each_strip_begins_where_the_one_before_it_ends(count: int) -> None:
    ends = zones(count)
    assert len(ends) == count
    assert [start for start, _ in ends] == [end for _, end in (ends[-1:] + ends[:-1])]
