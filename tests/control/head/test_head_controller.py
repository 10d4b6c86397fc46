from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.control.head import HeadController
from bestman_bt.messages import MotionErrorCode, Pose
from hal.api import MotionStatus
from tests.control.scripted_parts import ScriptedArm, ScriptedMotion
from tests.robot_models import with_limits

FRAME = "head_camera_optical_frame"


@pytest.mark.slow
@pytest.mark.parametrize("point", [(0.7, 0.0, 0.75), (0.8, 0.4, 0.9), (0.5, -0.8, 0.0), (-0.5, 1.2, 1.0)])
def test_the_camera_truly_looks_at_the_point_when_the_head_rests(simulate, point):
    simulated = simulate()
    handle = simulated.wait(simulated.head.look_at(point))
    assert handle.status is MotionStatus.SUCCEEDED, handle.failure
    target = simulated.truth.base_pose().apply(np.array(point))
    direction = simulated.truth.frame_pose(FRAME).inverse().apply(target)
    assert math.atan2(np.linalg.norm(direction[:2]), direction[2]) < math.radians(1.0)
    assert np.abs(simulated.robot.parts["head"].velocities()).max() < 0.02


def test_a_point_that_the_head_cannot_look_at_is_unreachable_and_nothing_moves(simulate):
    simulated = simulate()
    before = simulated.robot.parts["head"].positions()
    handle = simulated.head.look_at((-3.0, 0.0, 1.0))
    simulated.robot.clock.sleep(0.2)
    assert handle.status is MotionStatus.FAILED
    assert handle.failure.code is MotionErrorCode.UNREACHABLE
    np.testing.assert_allclose(simulated.robot.parts["head"].positions(), before, atol=1e-3)


class PanTilt:
    """As much of kinematics as a head needs: a camera 1.2 m up on a lift, that looks ahead at rest."""

    def pose(self, frame: str, joints: dict[str, float]) -> Pose:
        turned = Pose.from_xyz_rpy((0.1, 0.0, 1.2 + joints["lift"]), (0.0, joints["joint_2"], joints["joint_1"]))
        optical = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (-math.pi / 2, 0.0, -math.pi / 2))
        return turned @ optical


@pytest.mark.parametrize("lift", [0.0, 0.4])
def test_a_head_without_physics_is_told_angles_speed_and_stops(lift: float) -> None:
    group = ScriptedArm([0.1, -0.1], name="head")
    moves = []
    group.move_to = lambda positions, speed_scale=1.0: (
        moves.append((np.array(positions), speed_scale)) or ScriptedMotion()
    )
    joints = SimpleNamespace(positions=lambda: {"lift": lift, "joint_1": 0.1, "joint_2": -0.1})
    head = HeadController(group, PanTilt(), joints, "camera")
    for point in ((1.1, 1.0, 0.7), (1.1, -0.5, 1.5), (-0.9, -1.0, 1.0)):
        handle = head.look_at(point, 0.4)
        positions, speed = moves[-1]
        assert not handle.done
        assert speed == 0.4
        assert positions[0] == pytest.approx(math.atan2(point[1], point[0] - 0.1), abs=0.01)
        drop = 1.2 + lift - point[2]
        assert positions[1] == pytest.approx(math.atan2(drop, math.hypot(point[0] - 0.1, point[1])), abs=0.01)
    head.stop()
    assert group.stops == 1


@pytest.mark.parametrize(("beyond", "reaches"), [(2.9, True), (3.1, False)])
def test_a_head_that_comes_within_three_degrees_of_a_point_looks_at_it(beyond: float, reaches: bool) -> None:
    group = ScriptedArm([0.0, 0.0], name="head")
    group.model = with_limits(group.model, lower=-1.0, upper=1.0)
    joints = SimpleNamespace(positions=lambda: {"lift": 0.0, "joint_1": 0.0, "joint_2": 0.0})
    head = HeadController(group, PanTilt(), joints, "camera")
    angle = 1.0 + math.radians(beyond)
    handle = head.look_at((0.1 + math.cos(angle), math.sin(angle), 1.2))
    assert (handle.status is MotionStatus.RUNNING) == reaches
    assert len(group.motions) == reaches
    if not reaches:
        assert "3° beyond its limits" in handle.failure.text
