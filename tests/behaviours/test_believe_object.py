"""Believing in an object that was not looked at."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import SUCCESS
from bestman_bt.messages import Pose
from tests.behaviours.scripted import codes, load, run, scripted_skills

LEAF = '<BelieveObject object="cup" pose="{pose}" surface="table"/>'


@pytest.mark.parametrize(("rpy", "axis"), [((0.0, 0.0, 1.0), 2), ((np.pi / 2, 0.0, 0.0), 1)])
def test_an_object_is_believed_where_it_was_told_to_be_and_its_surface_at_its_foot(
    rpy: tuple[float, float, float], axis: int
) -> None:
    skills = scripted_skills()
    pose = Pose.from_xyz_rpy((3.0, -0.3, 0.8), rpy)
    assert run(skills, load(skills, LEAF, pose=pose)) == SUCCESS
    belief = skills.world.objects["cup"]
    assert (belief.pose, belief.surface, belief.recognised) == (pose, "table", True)
    slab = skills.world.obstacles["table/surface"].shapes[0]
    top = slab.pose.position[2] + slab.shape.size[2] / 2
    assert top == pytest.approx(0.8 + belief.model.bounds()[0, axis])


def test_an_object_without_a_model_is_refused() -> None:
    skills = scripted_skills()
    tree = load(skills, '<BelieveObject object="spoon" pose="0;0;1;0;0;0"/>')
    run(skills, tree)
    assert codes(skills) == ["unknown_object"]
    assert not skills.world.objects
