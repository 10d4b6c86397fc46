"""The steps of a bring-up in order; each completed step is written to the file immediately."""

from __future__ import annotations

import getpass
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from bestman_bt.bringup import controllers
from bestman_bt.bringup.brought_up_robot import BroughtUpRobot, fault_text
from bestman_bt.bringup.finding import CheckFinding, StepResult
from bestman_bt.bringup.killed_processes import dead_man, killed_processes
from bestman_bt.bringup.moving_parts import drive, gripper, joint_signs, stopping, turn
from bestman_bt.bringup.sensors import camera, wrench
from bestman_bt.robot_model.bringup_file import BringUpFile, Signature, SignedStep
from hal.api import RobotError


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
    Step("camera", "current images; a board of measured pose is detected there", camera),
    Step("joint-signs", "each joint by 1°", joint_signs, "each joint moves by 1° and back"),
    Step("gripper", "the empty hand opens, closes, stops half open, accepts a force", gripper, "the empty hand closes"),
    Step("wrench", "the wrist against the hand's weight", wrench, "the empty hand turns by 30° and back"),
    Step(
        "stopping",
        "distance and time of stops at three speeds",
        stopping,
        "the first joint swings by 35° at most, the base drives 0.3 m ahead and back",
    ),
    Step("dead-man", "the base stops when commands end", dead_man, "the base creeps ahead by up to 0.3 m"),
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
    """Execute the steps on a connected robot and write each result to the file; end after the first failed step.

    When all ``STEPS`` have passed, or do not apply, the file is signed. ``before``: called before each step.
    """
    file = begun(subject, path)
    subject.signed_serials, subject.signed_firmware = file.serial_numbers, file.firmware
    for step in steps:
        before(step)
        result = run_step(subject, step)
        if step.name == "identity" and result.outcome != "failed":
            reported = subject.identities()
            serials = {name: one.serial_number for name, one in reported.items() if one.serial_number}
            firmware = {name: one.firmware for name, one in reported.items() if one.firmware}
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
