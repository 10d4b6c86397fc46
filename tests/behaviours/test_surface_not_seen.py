"""What leaves tell that look at a surface from where it cannot be seen: a declared code, and where to go first."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from behaviours.failure import own_failures
from bestman_bt.engine import FAILURE
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.view import View
from bestman_bt.registry import BEHAVIOURS
from bestman_bt.world_model.world_model import ObjectBelief
from tests.behaviours.scripted import ASKEW, codes, load, map_from, run, scripted_skills

INTRINSICS = CameraIntrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)


@pytest.mark.parametrize(
    "leaf",
    [
        '<FindFreePlace object="cup" surface="counter/top" goal="{goal}"/>',
        '<FindPlacePose object="cup" surface="counter/top" goal="2;0;0.8" pose="{pose}"/>',
        '<DetectObject object="cup" surface="counter/top"/>',
        '<DetectObjects surface="counter/top"/>',
        '<EstimatePose object="cup"/>',
        '<ScanScene surface="counter/top" views="1"/>',
    ],
)
def test_a_surface_that_is_not_in_view_has_a_code_of_its_own_and_the_message_reports_where_to_go(leaf: str) -> None:
    skills = scripted_skills()
    pose = Pose(map_from(ASKEW, 0.7, 0.0, 0.8))
    skills.world.objects["cup"] = ObjectBelief("cup", skills.world.models["cup"], pose, 0.9, 0.002, 40.0)
    far = RGBDImage(np.zeros((48, 64, 3), np.uint8), np.full((48, 64), 0.2, np.float32), INTRINSICS, 50.0)
    view = View(far, Pose.from_xyz_rpy((0.0, 0.0, 1.2), (-np.pi / 2, 0.0, -np.pi / 2)))
    skills.camera = SimpleNamespace(
        capture=lambda: SimpleNamespace(map_from_base=ASKEW.to_pose(), in_base=view, stamp=50.0)
    )
    assert run(skills, load(skills, leaf)) == FAILURE
    assert codes(skills) == ["surface_not_seen"]
    assert "surface_not_seen" in own_failures(BEHAVIOURS.resolve(leaf[1:].split()[0]))
    why = skills.failures[0].why
    assert "no surface in view near x" in why
    assert "stand at the surface and look at it first (NavigateTo, LookAt)" in why
