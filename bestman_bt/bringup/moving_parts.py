"""Bring-up steps with small motions of each part, compared with the robot file: joints by a degree, the empty hand, the
base.

A joint must move by that distance in the commanded direction, and no other joint may move. The empty hand opens,
closes, opens half-way, and changes its force; it is open afterwards. The base drives 0.2 m, turns by 30° and returns,
by its own odometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from bestman_bt.bringup.brought_up_robot import SPEED, BroughtUpRobot, for_each_part
from bestman_bt.bringup.controllers import model_tool_pose, turn_between
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from bestman_bt.messages import Pose2D, wrap_angle
from hal.api import Arm, Gripper, JointGroup, MobileBase, Motion

JOINT_STEP = math.radians(1.0)
"""Radians; sliding joints: metres."""
JOINT_TOLERANCE = 0.3 * JOINT_STEP
SHIFT_TOLERANCE = 0.001
"""Largest difference between the motions of the controller's tool and of the model's, metres."""
WIDTH_TOLERANCE = 0.005
"""Metres."""
FORCE_SHARE = 0.5
DISTANCE, TURN = 0.2, math.radians(30.0)
DISTANCE_TOLERANCE, TURN_TOLERANCE = 0.01, math.radians(1.5)


def _signs_of(subject: BroughtUpRobot, name: str, group: JointGroup) -> CheckFinding:
    """Move each joint and back, and compare with the tool pose of the controller, if it reports one."""
    worst, figures = 0.0, {}
    for index, joint in enumerate(group.joint_names):
        here = group.positions()
        before = subject.robot.arm_facts(name) if name in subject.arms else None
        middle = 0.5 * (group.model.lower[index] + group.model.upper[index])
        there = here.copy()
        there[index] += JOINT_STEP if here[index] <= middle else -JOINT_STEP
        why = subject.finish(group.move_to(there, SPEED))
        moved = group.positions() - here
        shift = 0.0
        if before is not None and (after := subject.robot.arm_facts(name)) is not None:
            start, end = (model_tool_pose(subject, name, facts) for facts in (before, after))
            theirs = after.tool_pose.position - before.tool_pose.position
            shift = float(np.linalg.norm(theirs - (end.position - start.position)))
            turned = turn_between(before.tool_pose.inverse() @ after.tool_pose, start.inverse() @ end)
            shift = max(shift, turned * SHIFT_TOLERANCE / JOINT_TOLERANCE)
        subject.finish(group.move_to(here, SPEED))
        error = float(np.max(np.abs(moved - (there - here))))
        worst = max(worst, error)
        figures[joint] = round(math.degrees(float(moved[index])), 3)
        asked = math.degrees(there[index] - here[index])
        if error > JOINT_TOLERANCE:
            text = f"{joint} was commanded {asked:+.2f}° and moved {figures[joint]:+.2f}°{f' ({why})' if why else ''}"
            return judged(name, False, text, **figures)
        if shift > SHIFT_TOLERANCE:
            text = (
                f"the controller's tool moves {1e3 * shift:.1f} mm otherwise than ours when {joint} turns {asked:+.0f}°"
            )
            return judged(name, False, text, **figures)
    text = f"{len(group.joint_names)} joints moved as commanded, within {math.degrees(worst):.2f}°"
    return judged(name, True, text, **figures)


def _widths(subject: BroughtUpRobot, name: str, part: Gripper) -> CheckFinding:
    if "a gripper opens and closes" in subject.robot.unsupported:
        return not_applicable(name, subject.robot.unsupported["a gripper opens and closes"])
    narrow, wide = part.model.part.min_width, part.model.max_width
    figures: dict[str, float] = {}
    for what, width in (("open", wide), ("closed", narrow), ("half", 0.5 * (narrow + wide)), ("open again", wide)):
        why = subject.finish(part.move(width))
        figures[what.replace(" ", "_")] = measured = part.width()
        if why or abs(measured - width) > WIDTH_TOLERANCE:
            text = (
                f"{what}: commanded {1e3 * width:.1f} mm, measured {1e3 * measured:.1f} mm{f' ({why})' if why else ''}"
            )
            return judged(name, False, text, **figures)
        if what == "closed" and part.state().object_held:
            return judged(name, False, "closed without an object, it reports a held object", **figures)
    text = f"{1e3 * figures['closed']:.1f} to {1e3 * figures['open']:.1f} mm, half {1e3 * figures['half']:.1f} mm"
    return judged(name, True, text, **figures)


def _force(subject: BroughtUpRobot, name: str, part: Gripper) -> CheckFinding:
    missing = subject.robot.unsupported
    if "gripper force" in missing:
        return not_applicable(name, missing["gripper force"])
    force = FORCE_SHARE * part.model.part.max_force
    why = subject.finish(part.close(force)) or subject.finish(part.open())
    text = f"it closes with at most {force:.0f} N; no sensor measures it{f': {why}' if why else ''}"
    return judged(name, not why, text, force_n=force)


def _drive(subject: BroughtUpRobot, name: str, base: MobileBase) -> CheckFinding:
    def fits(moved: Pose2D) -> bool:
        return abs(moved.x - DISTANCE) <= DISTANCE_TOLERANCE and abs(moved.y) <= DISTANCE_TOLERANCE

    ways = (lambda: base.move_forward(DISTANCE), lambda: base.move_backward(DISTANCE))
    return _there_and_back(subject, name, base, f"{DISTANCE:g} m ahead", ways, fits)


def _turn(subject: BroughtUpRobot, name: str, base: MobileBase) -> CheckFinding:
    def fits(moved: Pose2D) -> bool:
        return abs(wrap_angle(moved.theta - TURN)) <= TURN_TOLERANCE

    ways = (lambda: base.rotate(TURN), lambda: base.rotate(-TURN))
    return _there_and_back(subject, name, base, f"{math.degrees(TURN):.0f}° to the left", ways, fits)


def _there_and_back(
    subject: BroughtUpRobot,
    name: str,
    base: MobileBase,
    commanded: str,
    ways: tuple[Callable[[], Motion[None]], Callable[[], Motion[None]]],
    fits: Callable[[Pose2D], bool],
) -> CheckFinding:
    start = base.odometry()
    why = subject.finish(ways[0]())
    moved = start.inverse() @ base.odometry()
    why = why or subject.finish(ways[1]())
    turned = math.degrees(moved.theta)
    text = (
        f"commanded {commanded}, moved {1e3 * moved.x:+.0f} mm ahead, {1e3 * moved.y:+.0f} mm aside, "
        f"{turned:+.1f}° to the left{f' ({why})' if why else ''}"
    )
    passed = fits(moved) and not why
    return judged(name, passed, text, ahead_m=moved.x, aside_m=moved.y, turned_deg=turned)


joint_signs = for_each_part(JointGroup, "no joints are", _signs_of)
gripper = for_each_part(Gripper, "no gripper is", _widths, _force)
drive, turn = for_each_part(MobileBase, "no base is", _drive), for_each_part(MobileBase, "no base is", _turn)


SPEEDS = (0.05, 0.1, 0.2)
"""Shares of the joint's limit."""
BASE_SPEEDS = (0.05, 0.1, 0.2)
"""Speed, m/s, or the base's limit if that is lower."""
SWING = 0.6
"""Largest motion of the first joint, radians."""
REST_TIME = 0.5
"""Seconds within which a robot is at rest after ``stop()``, as required by ``hal.api.Robot``."""
MEAN_SHARE, SPARE = 0.7, 0.005
"""Largest stopping distance, as a fraction of the distance at full speed in ``REST_TIME``, and an additional tolerance,
radians or metres.
"""
AT_REST, SLOWER = 0.01, 0.9
"""Speed of rest, rad/s or m/s; fraction of the speed below which the arm has started to brake."""
WATCHED, PERIOD, PATIENCE = 1.0, 0.004, 5.0


@dataclass(frozen=True)
class Stop:
    """One measured stop. ``speed``: at the stop command, ``unit`` per second. ``latency``, ``rest``: seconds from the
    command until the part slows down, and until it is at rest.

    ``way``: the stopping distance in ``unit``, rad or m.
    """

    unit: str
    speed: float
    latency: float
    rest: float
    way: float

    @property
    def longest_distance(self) -> float:
        """Return the largest promised stopping distance, in the unit."""
        return MEAN_SHARE * REST_TIME * self.speed + SPARE

    @property
    def met(self) -> bool:
        """Return whether the promise was kept."""
        return self.rest <= REST_TIME and self.way <= self.longest_distance

    def __str__(self) -> str:
        """Return the result for display."""
        return (
            f"at {self.speed:.2f} {self.unit}/s slower after {1e3 * self.latency:.0f} ms, at rest after "
            f"{1e3 * self.rest:.0f} ms and {self.way:.3f} {self.unit} "
            f"(at most {1e3 * REST_TIME:.0f} ms, {self.longest_distance:.3f} {self.unit})"
        )


def stopping(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Swing the first joint of each arm, drive each base forwards, stop the robot, and yield the measured stops."""
    bases = subject.parts(MobileBase)
    if not subject.arms and not bases:
        yield not_applicable(subject.model.name, "no arm or base is behind a connection")
    for name, arm in subject.arms.items():
        here = arm.positions()
        yield _stops(name, SPEEDS, partial(_stopped, subject, arm))
        subject.finish(arm.move_to(here, SPEED))
    for name, base in bases.items():
        start = base.odometry()
        yield _stops(name, BASE_SPEEDS, partial(_base_stopped, subject, base))
        subject.finish(base.move_backward(float((start.inverse() @ base.odometry()).x)))


def _stops(name: str, speeds: tuple[float, ...], stop_at: Callable[[float], Stop | str]) -> CheckFinding:
    stops = []
    for speed in speeds:
        stop = stop_at(speed)
        if isinstance(stop, str):
            return judged(name, False, stop)
        stops.append(stop)
    figures = {
        f"{what}_at_{speed:g}": value
        for speed, stop in zip(speeds, stops, strict=True)
        for what, value in (("latency_s", stop.latency), ("rest_s", stop.rest), (f"way_{stop.unit}", stop.way))
    }
    return judged(name, all(stop.met for stop in stops), "; ".join(map(str, stops)), **figures)


def _base_stopped(subject: BroughtUpRobot, base: MobileBase, speed: float) -> Stop | str:
    """Return the stop, or why there was none."""
    robot, asked = subject.robot, min(speed, base.model.part.max_vx)
    begun = robot.clock.now()
    while base.velocity().vx < SLOWER * asked:
        if robot.clock.now() - begun > PATIENCE:
            robot.stop()
            robot.clear_stop()
            return f"it did not reach {asked:.2f} m/s"
        base.set_velocity(asked, 0.0, 0.0)
        robot.clock.sleep(PERIOD)
    start, reached = base.odometry(), base.velocity().vx
    return _brought_to_rest(
        subject,
        "m",
        reached,
        lambda: abs(base.velocity().vx),
        lambda: float(np.linalg.norm(base.odometry().xy - start.xy)),
    )


def _stopped(subject: BroughtUpRobot, arm: Arm, share: float) -> Stop | str:
    """Return the stop, or why there was none."""
    robot, model = subject.robot, arm.model
    here, middle = arm.positions(), 0.5 * (model.lower[0] + model.upper[0])
    target = here.copy()
    target[0] = np.clip(here[0] + (SWING if here[0] <= middle else -SWING), model.lower[0], model.upper[0])
    asked = share * float(model.velocity[0])
    motion = arm.move_to(target, share)
    begun = robot.clock.now()
    while abs(float(arm.velocities()[0])) < SLOWER * asked:
        if motion.done or robot.clock.now() - begun > PATIENCE:
            robot.stop()
            robot.clear_stop()
            return f"it did not reach {asked:.2f} rad/s: {motion.failure or 'it is slower'}"
        robot.clock.sleep(PERIOD)
    reached, start = abs(float(arm.velocities()[0])), arm.positions()
    return _brought_to_rest(
        subject,
        "rad",
        reached,
        lambda: float(np.max(np.abs(arm.velocities()))),
        lambda: float(np.max(np.abs(arm.positions() - start))),
    )


def _brought_to_rest(
    subject: BroughtUpRobot, unit: str, reached: float, speed: Callable[[], float], way: Callable[[], float]
) -> Stop:
    """Stop the robot now, at the speed ``reached``, and watch."""
    robot, at = subject.robot, subject.robot.clock.now()
    robot.stop()
    latency, rest = 0.0, 0.0
    while (passed := robot.clock.now() - at) < WATCHED:
        now = speed()
        latency = passed if now > SLOWER * reached else latency
        rest = passed if now > AT_REST else rest
        robot.clock.sleep(PERIOD)
    stop = Stop(unit, reached, latency, rest, way())
    robot.clear_stop()
    return stop
