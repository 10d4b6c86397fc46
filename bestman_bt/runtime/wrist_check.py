"""Check of the sign of a real arm's wrist forces: by the weight of its hand in two poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.touch import WristWrench
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.robot_model.model import ArmModel
from hal.api import Arm, ForceTorque, MotionStatus, Robot, RobotError

TURN = math.radians(30.0)
"""Radians by which one of the last joints turns the hand."""
SPEED_SCALE = 0.05
READINGS, PERIOD = 50, 0.02
LEAST_CHANGE = 2.0
"""Smallest change of the weight, newtons, for a meaningful check."""
AGREEMENT = 0.5


@dataclass(frozen=True)
class WristCheck:
    """The result of the check. ``joint``: the joint that turned the hand. ``expected``, ``felt``: change of the weight
    along the expected direction, newtons.
    """

    joint: str
    expected: float
    felt: float

    @property
    def fault(self) -> str | None:
        """Return the fault as text, or None if the two values differ by at most half."""
        if self.expected < LEAST_CHANGE:
            return f"the hand's weight changes by {self.expected:.1f} N only: turn the arm to another posture first"
        share = self.felt / self.expected
        if share < -AGREEMENT:
            return "the wrist sensor has the opposite sign: it should measure the force of the world on the hand"
        if not AGREEMENT < share < 1.0 / AGREEMENT:
            return f"the wrist measures {share:.2f} of the weight of the hand in the robot file: wrong frame or hand"
        return None


def check_wrist(robot: Robot, arm_name: str, sensor_name: str) -> WristCheck:
    """Turn the hand of a connected robot by ``TURN``, slowly, and back. Raises RobotError if it does not move as
    commanded.
    """
    arm, sensor = robot.part(arm_name, Arm), robot.part(sensor_name, ForceTorque)
    wrist = WristWrench(sensor, ForwardKinematics(robot.model), JointStateSensor(robot.parts, robot.model), robot.clock)
    here = arm.positions()
    joint, target = _turn(robot, arm, wrist, here)
    felt, expected = _felt(robot, sensor), wrist.hand_weight()
    try:
        _move(robot, arm, target)
        felt, expected = _felt(robot, sensor) - felt, wrist.hand_weight() - expected
    finally:
        _move(robot, arm, here)
    size = float(np.linalg.norm(expected))
    return WristCheck(joint, size, float(felt @ expected) / max(size, 1e-9))


def _turn(robot: Robot, arm: Arm, wrist: WristWrench, here: NDArray[np.float64]) -> tuple[str, NDArray[np.float64]]:
    """Return the joint of the last three, and the positions (n,), that turn the weight in the hand the most."""
    model = robot.model.of(ArmModel)[arm.name]
    best, joint, target = -1.0, "", here
    for index in range(len(here) - 3, len(here)):
        for turn in (TURN, -TURN):
            there = here.copy()
            there[index] += turn
            if not model.lower[index] < there[index] < model.upper[index]:
                continue
            moved = dict(wrist.joints.positions()) | dict(zip(arm.joint_names, there.tolist(), strict=True))
            turned = wrist.kinematics.pose(wrist.frame, moved).rotation.T @ np.array([0.0, 0.0, -1.0])
            stays = wrist.kinematics.pose(wrist.frame, wrist.joints.positions()).rotation.T @ np.array([0.0, 0.0, -1.0])
            change = float(np.linalg.norm(turned - stays))
            if change > best + 1e-6:
                best, joint, target = change, arm.joint_names[index], there
    return joint, target


def _move(robot: Robot, arm: Arm, positions: NDArray[np.float64]) -> None:
    motion = arm.move_to(positions, SPEED_SCALE)
    while not motion.done:
        robot.clock.sleep(PERIOD)
    if motion.status is not MotionStatus.SUCCEEDED:
        raise RobotError(f"the hand could not be turned: {motion.failure}")


def _felt(robot: Robot, sensor: ForceTorque) -> NDArray[np.float64]:
    """Return the mean force (3,), after a moment for the hand to come to rest."""
    robot.clock.sleep(0.5)
    forces = []
    for _ in range(READINGS):
        robot.clock.sleep(PERIOD)
        forces.append(sensor.wrench().force)
    return np.asarray(np.mean(forces, axis=0))
