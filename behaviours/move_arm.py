"""Moving the arm: to a posture, and out of a place where the hand has worked."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from py_trees.ports import PortInformation

from behaviours.arm_motion import follow_path, hand_contacts, move_free
from behaviours.skill import Declaration, Skill, SkillFailure, Steps
from bestman_bt.manipulation.kinematics import cartesian_path
from bestman_bt.messages import Pose

ARRIVED = 0.02
"""Radians within which a posture counts as reached."""


class MoveArm(Skill):
    """Move the arm to a posture of the robot, around everything that is believed to be there."""

    INPUT_PORTS: ClassVar = {"posture": PortInformation(str, description="a posture of the robot, such as carry")}
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> Steps:
        """Plan and follow; at once done where the arm is there already."""
        goal = _posture(self, self.get_input("posture"))
        if np.abs(self.skills.arm_positions() - goal).max() > ARRIVED:
            yield from move_free(self, [goal])


class Retreat(Skill):
    """Take the hand straight back from where it has worked, then move the arm to a posture."""

    INPUT_PORTS: ClassVar = {
        "posture": PortInformation(str, required=False, default_value="carry", description="where to end"),
        "distance": PortInformation(float, required=False, default_value=0.1, description="straight back, metres"),
    }
    DECLARATION = Declaration(effects=("posture({posture})",))

    def execute(self) -> Steps:
        """Back along the hand's own axis as far as that is free, then on."""
        skills = self.skills
        goal = _posture(self, self.get_input("posture"))
        distance: float = self.get_input("distance")
        if skills.world.held is None and distance > 0:
            scene = skills.planning_scene(allowed_pairs=hand_contacts(skills, *skills.world.objects))
            world = skills.arm_world(scene)
            back = skills.base_from_tool() @ Pose(np.array([0.0, 0.0, -distance]))
            line = cartesian_path(skills.algorithms.kinematics, skills.arm_positions(), back, world.is_free)
            if len(line.path) > 1:
                yield from follow_path(self, line.path, world, speed=0.5)
        yield from move_free(self, [goal])


def _posture(skill: Skill, name: str) -> NDArray[np.float64]:
    try:
        return skill.skills.robot.posture(name, skill.skills.arm_model.joint_names)
    except KeyError as error:
        raise SkillFailure("unknown_posture", str(error.args[0])) from error
