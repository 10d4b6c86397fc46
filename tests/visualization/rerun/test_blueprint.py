from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.visualization.rerun.open_recording import eye_on

ROOM = np.array([[-3.0, -3.0, 0.0], [4.0, 3.0, 2.2]])


def test_the_eye_looks_down_on_the_middle_of_the_scene_from_outside():
    eye = eye_on(ROOM)
    assert eye.look_at[:2] == pytest.approx((0.5, 0.0))
    assert eye.position[2] > ROOM[1][2]
    assert np.linalg.norm(np.subtract(eye.position, eye.look_at)) > 4.5


def test_the_eye_keeps_its_distance_from_small_scenes():
    eye = eye_on(np.zeros((2, 3)))
    assert np.linalg.norm(np.subtract(eye.position, eye.look_at)) == pytest.approx(2.5)


def test_the_azimuth_is_the_side_that_the_eye_stands_on():
    east = eye_on(ROOM, azimuth=0.0)
    assert east.position[0] > east.look_at[0]
    assert east.position[1] == pytest.approx(east.look_at[1])
