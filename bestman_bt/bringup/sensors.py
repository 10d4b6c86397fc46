"""Bring-up steps for sensors: cameras are checked against a board, wrist sensors against the hand's weight."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.controllers import turn_between
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.perception.calibration.boards import CharucoBoard, board_pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.runtime.wrist_check import check_wrist
from hal.api import Camera, ForceTorque
from hal.simulation.parameters import SimulationParameters

BOARD = CharucoBoard(7, 5, 0.04, 0.03)
"""As ``docs/calibration.md`` prints it."""
LONGEST_AGE, TRIES = 1.0, 5
"""Largest age of an image, seconds; number of images of which the newest is used, as in skills, which accept ages up to
half a second.
"""
BOARD_TOLERANCE, BOARD_TURN = 0.015, math.radians(3.0)
"""Accuracy of a board's pose measured with a ruler and a spirit level, and by the camera."""


def camera(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Yield the findings of each camera; without ``subject.base_from_board`` the frames of cameras are not checked."""
    cameras = subject.parts(Camera)
    if not cameras:
        yield not_applicable(subject.model.name, "no camera is behind a connection")
    found: list[CheckFinding | None] = []
    for name, part in cameras.items():
        images = (part.capture() for _ in range(TRIES))
        age, image = min(((subject.robot.clock.now() - one.stamp, one) for one in images), key=lambda pair: pair[0])
        size = f"{image.intrinsics.width}×{image.intrinsics.height}"
        text = f"an image of {size} that is {1e3 * age:.0f} ms old (at most {1e3 * LONGEST_AGE:.0f})"
        yield judged(name, age <= LONGEST_AGE, text, age_s=age)
        if subject.base_from_board is None:
            reason = "no board was checked: give its pose with --board; see bestman-bt calibrate"
            yield not_applicable(f"{name}, frame", reason)
        else:
            base_from_eye = subject.pose(part.optical_frame, subject.model.base_frame)
            found.append(board_finding(name, image, base_from_eye, subject.base_from_board))
    for name, finding in zip(cameras, found, strict=False):
        blind = f"it sees no {BOARD.columns}×{BOARD.rows} ChArUco board from here"
        none = judged(name, False, blind) if not any(found) else not_applicable(f"{name}, frame", blind)
        yield finding or none


def board_finding(name: str, image: RGBDImage, base_from_eye: Pose, base_from_board: Pose) -> CheckFinding | None:
    """Return the finding for the board in an image, transformed to the base by the model's camera mount, or None."""
    sighting = BOARD.find(image.rgb)
    if sighting is None:
        return None
    seen = base_from_eye @ board_pose(sighting, image.intrinsics).eye_from_board
    apart = float(np.linalg.norm(seen.position - base_from_board.position))
    turned = turn_between(seen, base_from_board)
    text = (
        f"it sees the board {1e3 * apart:.0f} mm and {math.degrees(turned):.1f}° from where it was measured "
        f"(at most {1e3 * BOARD_TOLERANCE:.0f} mm and {math.degrees(BOARD_TURN):.0f}°)"
    )
    passed = apart <= BOARD_TOLERANCE and turned <= BOARD_TURN
    return judged(f"{name}, frame", passed, text, apart_mm=1e3 * apart, turned_deg=math.degrees(turned))


def board_in_view(model: RobotModel) -> str | None:
    """Return a pose for ``--board`` in view of the first camera behind a connection, in the start posture of simulated
    robots; None without a camera.
    """
    connected = {part for connection in model.connections.values() for part in connection.parts}
    frames = [camera.optical_frame for name, camera in model.of(CameraPart).items() if name in connected]
    if not frames:
        return None
    postures = SimulationParameters().initial_postures
    start = next((model.postures[name] for name in postures if name in model.postures), {})
    middle = Pose(np.array([*(np.array(BOARD.size) / 2), 0.0]))
    eye_from_board = Pose.from_xyz_rpy((0.0, 0.0, 0.45), (0.3, 0.2, 0.0)) @ middle.inverse()
    board = ForwardKinematics(model).pose(frames[0], start, model.base_frame) @ eye_from_board
    return " ".join(f"{number:.6f}" for number in (*board.position, *board.roll_pitch_yaw))


def wrench(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Yield the finding of each force-torque sensor that an arm carries and that has a connection."""
    wrists = {
        name: arm
        for name, part in subject.robot.parts.items()
        for arm in subject.arms
        if isinstance(part, ForceTorque) and _carries(subject, arm, part.frame)
    }
    if not wrists:
        yield not_applicable(subject.model.name, "no arm with a force-torque sensor is behind a connection")
    for name, arm in wrists.items():
        found = check_wrist(subject.robot, arm, name)
        text = f"the hand's weight changes by {found.expected:.1f} N when {found.joint} turns, felt {found.felt:.1f} N"
        text += f": {found.fault}" if found.fault else ""
        yield judged(name, found.fault is None, text, expected_n=found.expected, felt_n=found.felt)


def _carries(subject: BroughtUpRobot, arm: str, frame: str) -> bool:
    """Return whether a link hangs on an arm's flange: its pose there does not depend on the arm's joints."""
    flange, turned = flange_of(subject.model, arm), dict.fromkeys(subject.model.of(ArmModel)[arm].joint_names, 0.1)
    here, there = (subject.pose(frame, flange, moved) for moved in ({}, turned))
    return bool(np.allclose(here.matrix, there.matrix, atol=1e-6))
