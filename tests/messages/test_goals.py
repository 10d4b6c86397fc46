"""Several poses in one port."""

from __future__ import annotations

import pytest

from bestman_bt.messages import Goals, Pose2D


def test_text_of_several_poses_reads_back() -> None:
    goals = Goals((Pose2D(1.0, -2.0, 0.5), Pose2D(0.1, 0.0, -3.0)))
    assert Goals.from_string("1;-2;0.5;0.1;0;-3.0") == goals
    assert Goals.from_string(goals.to_string()) == goals
    assert Goals.from_string("") == ()


@pytest.mark.parametrize("text", ["1;2", "1;2;3;4", "a;b;c", "1;2;nan"])
def test_text_that_is_no_poses_is_refused(text) -> None:
    with pytest.raises(ValueError, match="expected"):
        Goals.from_string(text)
