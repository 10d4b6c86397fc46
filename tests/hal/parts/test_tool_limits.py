"""An arm's tool is held to its workspace and to its speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.robot_model.connection_config import SafetyConfig, WorkspaceConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from hal.parts.gate import ToolLimits


@pytest.fixture(scope="module")
def home(robot_model: RobotModel) -> np.ndarray:
    return robot_model.posture("home", robot_model.of(ArmModel)["arm"].joint_names)


def limits(model: RobotModel, **safety: object) -> ToolLimits:
    return ToolLimits(model, "arm", SafetyConfig(**safety))


def test_without_limits_nothing_is_outside_and_nothing_too_fast(robot_model: RobotModel, home: np.ndarray) -> None:
    tool = limits(robot_model)
    assert not tool.needed
    assert tool.outside(home) is None
    assert tool.slow_down(home[None], np.full((1, 7), 2.0)) == 1.0


def test_the_tool_is_where_the_arm_holds_it(robot_model: RobotModel, home: np.ndarray) -> None:
    tool = limits(robot_model).tool(home)
    turned = limits(robot_model).tool(home + np.array([np.pi / 2, 0, 0, 0, 0, 0, 0]))
    foot = np.array([0.15, 0.0])  # of the arm, on its column
    assert tool[:2] == pytest.approx([0.15 + 0.307, 0.0], abs=1e-3)  # as the Panda's maker draws this posture
    assert np.linalg.norm(turned[:2] - foot) == pytest.approx(np.linalg.norm(tool[:2] - foot), abs=1e-6)
    assert turned[2] == pytest.approx(tool[2])


def test_a_lift_below_the_arm_is_where_home_has_it(robot_model: RobotModel, home: np.ndarray) -> None:
    fixed = '<joint name="arm_mount_joint" type="fixed">'
    lift = (
        '<joint name="lift" type="prismatic"><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="0.5" velocity="0.1" effort="900"/>'
    )
    assert robot_model.urdf.count(fixed) == 1
    postures = {**robot_model.postures, "home": {**robot_model.postures["home"], "lift": 0.3}}
    lifted = replace(robot_model, urdf=robot_model.urdf.replace(fixed, lift), postures=postures)
    raised = limits(lifted).tool(home) - limits(robot_model).tool(home)
    assert raised == pytest.approx([0.0, 0.0, 0.3], abs=1e-9)


def test_a_target_outside_the_workspace_is_reported_with_axis_and_limits(
    robot_model: RobotModel, home: np.ndarray
) -> None:
    tool = limits(robot_model, workspace=WorkspaceConfig((-1.0, -1.0, 0.0), (0.4, 1.0, 2.0)))
    assert "x = " in str(tool.outside(home))
    assert "0.400" in str(tool.outside(home))


def test_the_way_is_looked_at_too(robot_model: RobotModel, home: np.ndarray) -> None:
    around = np.array([1.2, 0, 0, 0, 0, 0, 0])
    reach = limits(robot_model).tool(home)[0] - 0.02
    tool = limits(robot_model, workspace=WorkspaceConfig((-2.0, -2.0, 0.0), (reach, 2.0, 3.0)))
    assert tool.outside(home + around) is None
    assert tool.outside(home - around) is None
    assert tool.outside_on_the_way(home - around, home + around) is not None
    assert tool.outside_on_the_way(home + around, home - around) is not None


def test_a_fast_tool_is_slowed_down_to_its_limit(robot_model: RobotModel, home: np.ndarray) -> None:
    tool = limits(robot_model, tool_speed=0.1)
    velocity = np.array([1.0, 0, 0, 0, 0, 0, 0])
    share = tool.slow_down(home[None], velocity[None])
    assert share < 1.0
    assert tool.tool_speed(home, share * velocity) == pytest.approx(0.1)


def test_the_speed_of_the_tool_is_the_derivative_of_its_place(robot_model: RobotModel, home: np.ndarray) -> None:
    tool, velocity, dt = limits(robot_model), np.linspace(-1.0, 1.0, 7), 1e-5
    moved = tool.tool(home + dt * velocity) - tool.tool(home)
    assert tool.tool_speed(home, velocity) == pytest.approx(float(np.linalg.norm(moved)) / dt, rel=1e-3)
