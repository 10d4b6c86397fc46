"""Arms that are drawn from Denavit-Hartenberg parameters have their flange where the convention's formula has it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio
import pytest

from bestman_bt.robot_model.compose import combine
from bestman_bt.robot_model.model import ArmModel

HALF_TURN, QUARTER = np.diag([-1.0, -1.0, 1.0, 1.0]), np.pi / 2
LINKS = [f"arm_{name}_link" for name in ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")]
UNIVERSAL_ROBOTS = {  # of their article on DH parameters: d1, a2, a3, d4, d5, d6 in metres, and kg of all moving links
    "ur3e_arm": ((0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921), 8.7995),
    "ur5e_arm": ((0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996), 17.7),
    "ur10e_arm": ((0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655), 29.104),
}


@pytest.mark.parametrize("part", UNIVERSAL_ROBOTS)
def test_flange_and_masses_are_those_that_the_maker_publishes(part: str) -> None:
    (d1, a2, a3, d4, d5, d6), mass = UNIVERSAL_ROBOTS[part]
    robot = combine("omni_base", part, "wsg50")
    arm = robot.of(ArmModel)["arm"]
    model = pinocchio.buildModelFromXML(robot.urdf)
    data, base = model.createData(), model.getFrameId(arm.base_frame)
    joints = [model.joints[model.getJointId(name)] for name in arm.joint_names]
    for positions in np.random.default_rng(0).uniform(-np.pi, np.pi, (20, 6)):
        q = pinocchio.neutral(model)
        q[[joint.idx_q for joint in joints]] = positions
        pinocchio.framesForwardKinematics(model, data, q)
        flange = data.oMf[base].actInv(data.oMf[model.getFrameId("arm_tool0")])
        expected = HALF_TURN
        for angle, d, a, alpha in zip(
            positions, (d1, 0, 0, d4, d5, d6), (0, a2, a3, 0, 0, 0), (QUARTER, 0, 0, QUARTER, -QUARTER, 0), strict=True
        ):
            c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
            rows = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
            expected = expected @ np.array(rows)
        assert flange.homogeneous == pytest.approx(expected, abs=1e-7)
    moving = ET.fromstring(robot.urdf).findall("link")
    kilograms = sum(float(link.find("inertial/mass").get("value")) for link in moving if link.get("name") in LINKS)
    assert kilograms == pytest.approx(mass, abs=0.01)
