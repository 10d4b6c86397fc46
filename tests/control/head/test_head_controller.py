from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control import ControlErrorCode, ControlStatus

FRAME = "head_camera_optical_frame"


@pytest.mark.parametrize("point", [(0.7, 0.0, 0.75), (0.8, 0.4, 0.9), (0.5, -0.8, 0.0), (-0.5, 1.2, 1.0)])
def test_the_camera_truly_looks_at_the_point_when_the_head_rests(simulate, point):
    simulated = simulate()
    handle = simulated.wait(simulated.head.look_at(point))
    assert handle.status is ControlStatus.SUCCEEDED, handle.error
    target = simulated.truth.base_pose().apply(np.array(point))
    direction = simulated.truth.frame_pose(FRAME).inverse().apply(target)
    assert math.atan2(np.linalg.norm(direction[:2]), direction[2]) < math.radians(1.0)
    assert np.abs(simulated.robot.parts["head"].velocities()).max() < 0.02


def test_a_point_that_the_head_cannot_look_at_is_unreachable_and_nothing_moves(simulate):
    simulated = simulate()
    before = simulated.robot.parts["head"].positions()
    handle = simulated.head.look_at((-3.0, 0.0, 1.0))
    simulated.robot.clock.sleep(0.2)
    assert handle.status is ControlStatus.FAILED
    assert handle.error.code is ControlErrorCode.UNREACHABLE
    np.testing.assert_allclose(simulated.robot.parts["head"].positions(), before, atol=1e-3)
