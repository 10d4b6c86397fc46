"""What an operator may set, and what the robot is told while an execution waits."""

from __future__ import annotations

import pytest

from bestman_bt.control.operator_speed import OperatorSpeed


def test_a_robot_waits_while_it_is_held_and_goes_on_at_the_speed_that_was_set_meanwhile() -> None:
    told: list[float] = []
    speed = OperatorSpeed(told.append)
    speed.set(0.3)
    speed.held("a pause")
    speed.set(0.5)
    speed.held(None)
    speed.resume()
    assert told == [0.3, 0.0, 0.0, 0.5]
    assert speed.share == 0.5


def test_in_simulation_time_stands_still_and_nothing_has_to_wait() -> None:
    told: list[float] = []
    speed = OperatorSpeed(told.append, stands_still=True)
    speed.hold()
    speed.resume()
    assert told == []


@pytest.mark.parametrize("share", [0.0, 0.049, 1.01, float("nan")])
def test_a_share_out_of_range_is_refused_and_changes_nothing(share: float) -> None:
    told: list[float] = []
    speed = OperatorSpeed(told.append)
    with pytest.raises(ValueError, match="a speed is 5% to 100%"):
        speed.set(share)
    assert (told, speed.share) == ([], 1.0)
