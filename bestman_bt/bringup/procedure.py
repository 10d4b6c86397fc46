"""The steps of a bring-up in order; each completed step is written to the file at once."""

from __future__ import annotations

import getpass
import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bestman_bt.bringup import controllers
from bestman_bt.bringup.brought_up_robot import BroughtUpRobot, fault_text
from bestman_bt.bringup.controllers import turn_between
from bestman_bt.bringup.finding import CheckFinding, StepResult, judged, not_applicable
from bestman_bt.bringup.killed_processes import dead_man, killed_processes
from bestman_bt.bringup.moving_parts import drive, gripper, joint_signs, stopping, turn
from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.perception.calibration.boards import CharucoBoard, board_pose
from bestman_bt.robot_model.bringup_file import BringUpFile, Signature, SignedStep
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.robot_model.payload import flange_of
from bestman_bt.runtime.wrist_check import check_wrist
from hal.api import Camera, ForceTorque, RobotError

BOARD = CharucoBoard(7, 5, 0.04, 0.03)
"""As ``docs/calibration.md`` prints it."""
LONGEST_AGE, TRIES = 1.0, 5
"""Seconds; images of which the newest counts. Skills take images of up to half a second."""
BOARD_TOLERANCE, BOARD_TURN = 0.015, math.radians(3.0)
"""What a ruler and a spirit level measure a board's place to, and a camera sees it."""


def camera(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Yield the findings of each camera; without ``subject.base_from_board`` the frames of cameras are not checked."""
    cameras = subject.parts(Camera)
    if not cameras:
        yield not_applicable(subject.model.name, "no camera is behind a connection")
    found: list[CheckFinding | None] = []
    for name, part in cameras.items():
        age, image = min(((_age(subject, image), image) for image in _images(part)), key=lambda pair: pair[0])
        size = f"{image.intrinsics.width}×{image.intrinsics.height}"
        text = f"an image of {size} that is {1e3 * age:.0f} ms old (at most {1e3 * LONGEST_AGE:.0f})"
        yield judged(name, age <= LONGEST_AGE, text, age_s=age)
        if subject.base_from_board is None:
            reason = "no board was looked at: say where one is (--board), and bestman-bt calibrate"
            yield not_applicable(f"{name}, frame", reason)
        else:
            base_from_eye = subject.pose(part.optical_frame, subject.model.base_frame)
            found.append(board_finding(name, image, base_from_eye, subject.base_from_board))
    for name, finding in zip(cameras, found, strict=False):
        blind = f"it sees no {BOARD.columns}×{BOARD.rows} ChArUco board from here"
        none = judged(name, False, blind) if not any(found) else not_applicable(f"{name}, frame", blind)
        yield finding or none


def _images(part: Camera) -> Iterator[RGBDImage]:
    """Check that images arrive as often as skills need new ones."""
    for _ in range(TRIES):
        yield part.capture()


def _age(subject: BroughtUpRobot, image: RGBDImage) -> float:
    return subject.robot.clock.now() - image.stamp


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
    """Return whether a link hangs on an arm's flange: it stays where it is there, however the arm turns."""
    flange, turned = flange_of(subject.model, arm), dict.fromkeys(subject.model.of(ArmModel)[arm].joint_names, 0.1)
    here, there = (subject.pose(frame, flange, moved) for moved in ({}, turned))
    return bool(np.allclose(here.matrix, there.matrix, atol=1e-6))


@dataclass(frozen=True)
class Step:
    """One step. ``moves``: the parts that move, for the confirmation; empty if none moves."""

    name: str
    what: str
    look: Callable[[BroughtUpRobot], Iterable[CheckFinding]]
    moves: str = ""


STEPS = (
    Step("identity", "model, serial number and firmware of the controllers", controllers.identity),
    Step("limits", "joints within their ranges, and those within the controller's", controllers.limits),
    Step("tool", "the controller's tool (TCP) against the file's", controllers.tool),
    Step("payload", "what the controller counts on at the flange", controllers.payload_mass),
    Step("mounting", "how the arm is mounted", controllers.mounting),
    Step("tool-pose", "the tool's pose by the controller against our kinematics", controllers.tool_pose),
    Step("camera", "images of now; a board whose place was measured is seen there", camera),
    Step("joint-signs", "each joint by 1°", joint_signs, "each joint moves by 1° and back"),
    Step("gripper", "the empty hand opens, closes, stands half open, takes a force", gripper, "the empty hand closes"),
    Step("wrench", "the wrist against the hand's weight", wrench, "the empty hand turns by 30° and back"),
    Step(
        "stopping",
        "way and time of stops at three speeds",
        stopping,
        "the first joint swings by 35° at most, the base drives 0.3 m ahead and back",
    ),
    Step("dead-man", "the base stands when commands cease", dead_man, "the base creeps ahead by up to 0.3 m"),
    Step("drive", "the base drives 0.2 m", drive, "the base drives 0.2 m ahead and back"),
    Step("turn", "the base turns by 30°", turn, "the base turns by 30° and back"),
    Step("kill", "kill -9 of each process", killed_processes, "the first joint swings by 12°; processes are killed"),
)


def run_step(subject: BroughtUpRobot, step: Step) -> StepResult:
    """Run one step. Faults of the robot become findings; they are not raised."""
    findings: list[CheckFinding] = []
    try:
        if step.moves:
            subject.make_ready()
        findings.extend(step.look(subject))
    except RobotError as error:
        findings.append(CheckFinding(subject.model.name, "failed", fault_text(error)))
    return StepResult(step.name, tuple(findings))


def bring_up(
    subject: BroughtUpRobot,
    path: Path,
    steps: Iterable[Step] = STEPS,
    before: Callable[[Step], None] = lambda step: None,
) -> Iterator[StepResult]:
    """Do the steps on a connected robot, and write each one into the file; ends after one that has failed.

    When all ``STEPS`` have passed, or do not apply, the file is signed. ``before``: called before each step.
    """
    file = begun(subject, path)
    subject.signed_serials, subject.signed_firmware = file.serial_numbers, file.firmware
    for step in steps:
        before(step)
        result = run_step(subject, step)
        if step.name == "identity" and result.outcome != "failed":
            told = subject.identities()
            serials = {name: one.serial_number for name, one in told.items() if one.serial_number}
            firmware = {name: one.firmware for name, one in told.items() if one.firmware}
            file = replace(file, serial_numbers=serials, firmware=firmware)
        done = SignedStep(result.outcome, now(), user(), result.text, result.measured)
        file = signed_if_complete(replace(file, steps={**file.steps, step.name: done}))
        file.write(path)
        yield result
        if result.outcome == "failed":
            return


def begun(subject: BroughtUpRobot, path: Path) -> BringUpFile:
    """Return the existing bring-up file, or a new one if there is none or the robot's file has changed since."""
    if path.is_file():
        file = BringUpFile.read(path)
        if file.content == subject.model.content:
            return file
    return BringUpFile(subject.model.name, subject.model.content, twin=subject.twin)


def left(file: BringUpFile) -> list[Step]:
    """Return the steps that are still to be done."""
    done = {name for name, step in file.steps.items() if step.outcome != "failed"}
    return [step for step in STEPS if step.name not in done]


def signed_if_complete(file: BringUpFile) -> BringUpFile:
    """Return the file, signed if no step is left, else unsigned."""
    return replace(file, signed=None if left(file) else Signature(user(), now()))


def now() -> str:
    """Return the current UTC time as text, to the second."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())


def user() -> str:
    """Return the login name of the user."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"
