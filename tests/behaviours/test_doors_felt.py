"""Where a door is by feel: the true handle and its true way give the true front, where the map is wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.furniture.articulation_measurement import articulation_from_motion, grown
from behaviours.furniture.opening import Opening
from bestman_bt.messages import Box
from tests.behaviours.test_doors_seen import OFF, door_and_handle


@pytest.mark.parametrize(("name", "part", "opened"), [("fridge", "upper_door", 1.2), ("drawer_chest", "drawer_2", 0.2)])
def test_the_front_is_where_it_really_is_in_the_direction_that_it_faces(name: str, part: str, opened: float) -> None:
    door, handle = door_and_handle(name, part, 0.0)
    _, moved = door_and_handle(name, part, opened)
    revolute = door.articulation.kind == "revolute"
    handle = replace(handle, hinge_direction=door.axis()[1] if revolute else None)
    opening = Opening(door, handle, opened, 0.0, 1.0, opened if revolute else None)
    angle = opened if revolute else 0.0
    felt = articulation_from_motion(opening, handle.pose.position, moved.pose.position, angle, 0.0)
    really = OFF.to_pose() @ door.articulation.moved(opened) @ door.articulation.shapes[0].pose
    front = felt.shapes[0]
    apart = front.pose.position - really.position
    assert abs(float(apart @ moved.outward)) < 1e-3
    assert float(np.linalg.norm(apart)) < 0.06  # along the front the map's error stays
    assert float(front.pose.rotation[:, 0] @ really.rotation[:, 0]) > math.cos(math.radians(0.1))
    size = door.articulation.shapes[0].shape.size
    assert front.shape.size == pytest.approx((size[0], size[1] + 2 * door.furniture.position_error, size[2]))


def test_a_door_is_grown_on_all_sides() -> None:
    door, handle = door_and_handle("drawer_chest", "drawer_2", 0.0)
    at = handle.pose.position
    felt = articulation_from_motion(Opening(door, handle, 0.2, 0.0, 0.2, None), at, at, 0.0, 0.0)
    for before, after in zip(felt.shapes, grown(felt, 0.01).shapes, strict=True):
        assert isinstance(before.shape, Box)
        assert isinstance(after.shape, Box)
        assert after.shape.size == pytest.approx(np.add(before.shape.size, 0.02))
        assert after.pose is before.pose
