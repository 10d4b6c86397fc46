"""A base with a head behind rosbridge, over its twin: what it has passes, and the rest tells why it does not apply."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hal.bringup.brought_up_twins import brought_up, passes

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]
ROSBRIDGE_ROBOT = Path(__file__).parents[1] / "rosbridge" / "ros_robot.yaml"


def test_a_robot_behind_rosbridge_alone_is_brought_up(tmp_path: Path) -> None:
    without = {"identity", "tool", "payload", "mounting", "tool-pose", "gripper", "wrench"}
    with brought_up(str(ROSBRIDGE_ROBOT), "roslibpy") as (subject, _):
        file = passes(subject, tmp_path / "robot.bringup", without)
    stops = file.steps["stopping"].measured["base"]
    assert 0.0 < stops["way_m_at_0.05"] < stops["way_m_at_0.2"] < 0.1
    assert "no arm is behind a connection" in file.steps["tool-pose"].text
