"""Checks of motions: they reach their target, can be cancelled and superseded, and their end is final.

Grippers reach the requested widths.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import JointTrajectory
from hal.api import (
    Arm,
    CommandRefusedError,
    Gripper,
    JointGroup,
    MobileBase,
    Motion,
    MotionErrorCode,
    MotionStatus,
    Robot,
)
from hal.conformance.subject import (
    ARMS,
    GRIPPERS,
    GROUPS,
    POLL,
    REST_TIME,
    Check,
    ConformanceError,
    each,
    finish,
    first,
    keep_velocity,
    nearby,
    parts_of,
    require,
    require_rest,
    waits_for_sleeps,
)

BLOCKING, BLOCKING_OF_THE_MACHINE = 0.05, 0.15
"""Longest duration of a non-blocking call, seconds of the robot's clock and of wall time, which a busy machine extends.
"""
ASKED = 5
"""Number of commands sent to check for blocking; a busy machine may delay half of them."""
REACTION = 0.15
"""Seconds from a call to its measured effect: two control periods of 20 Hz and the encoders' latency."""

COMMANDS_EACH = 200
SMALL_TURN = 0.001
"""Radians or metres."""
AT_ONCE, LONGEST_TURN = 0.002, 0.3
"""Seconds: period at which motions are polled, and maximum mean duration of a small command."""
FALL, MOVED = 0.15, 0.02
"""Seconds without effort; radians or metres by which efforts have to move a joint for it to count."""
UNEVEN = 0.023
"""Seconds between readings of a velocity that may oscillate with the controller's period; not a multiple of one."""
READINGS_APART, READINGS_APART_IN_REAL_TIME = 4, 16
"""Numbers of readings over which a speed is averaged: two control periods of 20 Hz; more where a busy machine may delay
a reading by as much; twice as many for long, slow motions.
"""


def joints_arrive_within_their_limits(robot: Robot) -> None:
    """Check that every group reaches its target, at full and at quarter speed, and never exceeds its speed by more than
    5 %.

    On a robot in real time, in at least one of three attempts, because a busy machine reads late.
    """
    for group in _groups(robot):
        for scale, longer in ((1.0, 1), (0.25, 2)):
            _keep_the_limits(robot, group, partial(_move_nearby, robot, group, scale), scale, longer)


def _move_nearby(robot: Robot, group: JointGroup, scale: float) -> Iterator[Motion[None]]:
    """Yield a motion and, when it is over, require that it has arrived."""
    target = nearby(robot, group, 0.6)
    motion = group.move_to(target, scale)
    require(motion.status is MotionStatus.RUNNING and motion.failure is None, "a new motion should be RUNNING")
    yield motion
    error = float(np.max(np.abs(group.positions() - target)))
    require(error < 0.01, f"{group.name} is {error:.4f} off its target")


def commands_do_not_block(robot: Robot) -> None:
    """Check that commands and stops return before the motion has progressed, in most of five tries.

    Measured by the robot's clock and by wall time: if time passes only in sleeps, the robot's clock shows only sleeps.
    """
    commands: list[Callable[[], object]] = [
        partial(group.move_to, nearby(robot, group), 0.1) for group in _groups(robot)
    ]
    commands += [gripper.open for gripper in parts_of(robot, Gripper)]
    commands += [gripper.close for gripper in parts_of(robot, Gripper)]
    for base in parts_of(robot, MobileBase):
        commands += [partial(base.set_velocity, 0.0, 0.0, 0.1), partial(base.rotate, 0.5)]
    for command in (*commands, robot.stop):
        passed, waited = np.median([_time_of(robot, command) for _ in range(ASKED)], axis=0)
        require(passed < BLOCKING, f"{command} took {passed:.3f} s of the robot's time")
        require(waited < BLOCKING_OF_THE_MACHINE, f"{command} took {waited:.3f} s of the machine's time")


@each(JointGroup)
def a_cancelled_motion_comes_to_rest(robot: Robot, group: JointGroup) -> None:
    """Check that the status of a cancelled motion is CANCELED, permanently."""
    motion = group.move_to(nearby(robot, group), 0.5)
    robot.clock.sleep(0.2)
    motion.cancel()
    require_rest(robot, "cancel()")
    motion.cancel()
    require(motion.status is MotionStatus.CANCELED, f"a cancelled motion is {motion.status}")


def a_motion_is_cancelled_within_a_control_period(robot: Robot) -> None:
    """Check that a motion has ended when ``cancel`` returns, and travels only the braking distance within the
    limits.
    """
    for group in _groups(robot):
        motion = group.move_to(nearby(robot, group, 0.8), 0.3)
        robot.clock.sleep(0.4)
        before, then = group.positions(), robot.clock.now()
        robot.clock.sleep(POLL)
        start = group.positions()
        speed = np.maximum(np.abs(group.velocities()), np.abs(start - before) / (robot.clock.now() - then))
        motion.cancel()
        require(motion.status is MotionStatus.CANCELED, f"right after cancel() a motion is {motion.status}")
        robot.clock.sleep(1.0)
        way = np.abs(group.positions() - start)
        braking = speed**2 / (2.0 * group.model.acceleration)
        excess = float(np.max(way - speed * REACTION - braking))
        require(excess < 0.005, f"{group.name} went {excess:.4f} farther after cancel() than braking at once takes")


def a_command_from_a_second_thread_is_obeyed(robot: Robot) -> None:
    """Check that a motion commanded from a second thread arrives while the first one sleeps and reads."""
    group = first(robot, JointGroup)
    target = nearby(robot, group)
    with ThreadPoolExecutor(1) as second:
        command = second.submit(group.move_to, target)
        robot.clock.sleep(0.1)
        group.positions()
        motion = command.result(timeout=5.0)
        reading = second.submit(group.positions)
        robot.clock.sleep(0.1)
        require(len(reading.result(timeout=5.0)) == len(target), "a second thread should be able to read")
    finish(robot, motion)
    require(motion.status is MotionStatus.SUCCEEDED, f"a motion from a second thread ended {motion.status}")
    error = float(np.max(np.abs(group.positions() - target)))
    require(error < 0.01, f"a motion from a second thread ended {error:.4f} off its target")


@each(JointGroup)
def a_newer_command_takes_over(robot: Robot, group: JointGroup) -> None:
    """Check that the older motion is cancelled as superseded and the newer one arrives."""
    start = group.positions()
    older = group.move_to(nearby(robot, group), 0.5)
    robot.clock.sleep(0.2)
    newer = group.move_to(start, 0.5)
    code = older.failure.code if older.failure else None
    require(older.status is MotionStatus.CANCELED, f"a superseded motion is {older.status}, not CANCELED")
    require(code is MotionErrorCode.SUPERSEDED, f"its error code is {code}, not SUPERSEDED")
    finish(robot, newer)
    require(newer.status is MotionStatus.SUCCEEDED, f"the newer motion ended {newer.status}: {newer.failure}")
    error = float(np.max(np.abs(group.positions() - start)))
    require(error < 0.01, f"the newer motion ended {error:.4f} off its target")
    older.cancel()
    robot.clock.sleep(0.2)
    require(newer.status is MotionStatus.SUCCEEDED, "cancelling an ended motion should do nothing")


def a_part_at_rest_takes_the_next_command_at_once(robot: Robot) -> None:
    """Send ``COMMANDS_EACH`` small commands to each part in direct succession: a finished motion must not delay the
    next.

    All parts run at the same time, to save time.
    """
    turns = [_turns_of(part) for part in robot.parts.values() if isinstance(part, JointGroup | Gripper | MobileBase)]
    motions: dict[int, Motion[None] | None] = dict.fromkeys(range(len(turns)))
    deadline = robot.clock.now() + LONGEST_TURN * COMMANDS_EACH
    while motions:
        for number, motion in tuple(motions.items()):
            if motion is not None and not motion.done:
                continue
            if motion is not None and motion.status is not MotionStatus.SUCCEEDED:
                raise ConformanceError(f"a small motion ended {motion.status}: {motion.failure}")
            try:
                motions[number] = next(turns[number])
            except StopIteration:
                del motions[number]
            except CommandRefusedError as error:
                raise ConformanceError(f"a command right after a motion has succeeded was refused: {error}") from error
        require(robot.clock.now() < deadline, f"{COMMANDS_EACH} small commands took over {LONGEST_TURN} s each")
        robot.clock.sleep(AT_ONCE)


def _turns_of(part: JointGroup | Gripper | MobileBase) -> Iterator[Motion[None] | None]:
    """Yield small commands of a part, forward and back, each started when the next one is requested; None: without a
    motion.
    """
    if isinstance(part, JointGroup):
        here = part.positions()
        room = part.model.upper - here > here - part.model.lower
        there = here + np.where(room, SMALL_TURN, -SMALL_TURN)
        there[1:] = here[1:]
        for turn in range(COMMANDS_EACH):
            target = here if turn % 2 else there
            if isinstance(part, Arm) and turn % 4 == 1:
                way = np.array([part.positions(), target])
                yield part.follow(JointTrajectory(part.joint_names, np.array([0.0, 0.1]), way, np.zeros_like(way)))
            elif turn % 4 == 3:
                part.command(target)
                yield None
            else:
                yield part.move_to(target)
    elif isinstance(part, Gripper):
        closed, opened = part.model.part.min_width, part.model.max_width
        nearer = opened if 2 * part.width() > closed + opened else closed
        for _ in range(COMMANDS_EACH):
            yield part.move(nearer)
    else:
        for turn in range(COMMANDS_EACH):
            if turn % 2:
                part.set_velocity(0.0, 0.0, 0.0)
                yield None
            else:
                yield part.rotate(SMALL_TURN if turn % 4 else -SMALL_TURN)


@each(JointGroup)
def set_points_are_held(robot: Robot, group: JointGroup) -> None:
    """Check that positions and velocities set by ``command`` hold; a velocity of zero stops."""
    target = nearby(robot, group, 0.1)
    group.command(positions=target)
    robot.clock.sleep(1.5)
    error = float(np.max(np.abs(group.positions() - target)))
    require(error < 0.01, f"{group.name} is {error:.4f} off its commanded positions")
    speed = np.zeros(len(target))
    speed[0] = min(0.1, group.model.velocity[0] / 2)
    speed[0] *= 1 if target[0] < (group.model.lower[0] + group.model.upper[0]) / 2 else -1
    begin = robot.clock.now()
    keep_velocity(robot, group, speed, 1.0)
    moved, passed = float(group.positions()[0] - target[0]), robot.clock.now() - begin
    difference = abs(moved - speed[0] * passed)
    require(difference < 0.03, f"{group.name} moved {moved:.3f} in {passed:.2f} s at {speed[0]} per second")
    group.command(velocities=np.zeros(len(target)))
    require_rest(robot, "a velocity of zero")


@each(JointGroup)
def velocities_are_the_rate_of_positions(robot: Robot, group: JointGroup) -> None:
    """Check that velocities have the unit, sign and order of positions: the motion in half a second matches the
    velocity.

    One of three tries suffices, because a busy machine may skip readings.
    """
    middle = (group.model.lower + group.model.upper) / 2
    wrong = ""
    for _ in range(3):
        speed = np.where(group.positions() < middle, 1, -1) * np.minimum(0.1, group.model.velocity / 2)
        keep_velocity(robot, group, speed, 0.4)
        start, begin, said = group.positions(), robot.clock.now(), []
        for _ in range(22):
            keep_velocity(robot, group, speed, UNEVEN)
            said.append(group.velocities())
        rate = (group.positions() - start) / (robot.clock.now() - begin)
        group.command(velocities=np.zeros(len(speed)))
        error = np.abs(np.mean(said, axis=0) - rate)
        worst = int(np.argmax(error))
        if error[worst] < 0.03:
            return
        words = f"said {np.mean(said, axis=0)[worst]:.4f} and moved {rate[worst]:.4f} per second"
        wrong = f"{group.joint_names[worst]} {words}"
    raise ConformanceError(wrong)


@each(JointGroup)
def a_command_after_efforts_starts_from_the_joints(robot: Robot, group: JointGroup) -> None:
    """Check that joints that efforts have moved are not pulled back to where they were; a driver may refuse efforts."""
    before = group.positions()
    try:
        group.command(efforts=np.zeros(len(before)))
    except CommandRefusedError:
        return
    robot.clock.sleep(FALL)
    here = group.positions()
    group.command(velocities=np.zeros(len(before)))
    robot.clock.sleep(REST_TIME)
    moved, left = np.abs(here - before), np.abs(group.positions() - before)
    for joint, way, rest in zip(group.joint_names, moved, left, strict=True):
        pulled_back = way > MOVED and rest < way / 2
        require(not pulled_back, f"efforts moved {joint} by {way:.4f}; by the next command it is back at {rest:.4f}")


@each(JointGroup)
def velocities_of_joints_lapse(robot: Robot, group: JointGroup) -> None:
    """Check that the joints brake a quarter of a second after the last velocity command, since the client may be
    gone.
    """
    middle = (group.model.lower + group.model.upper) / 2
    speed = np.where(group.positions() < middle, 1, -1) * np.minimum(0.1, group.model.velocity / 2)
    group.command(velocities=speed)
    robot.clock.sleep(0.25)
    require_rest(robot, "the last commanded velocity")


@each(Arm)
def trajectories_keep_the_limits_between_their_samples(robot: Robot, arm: Arm) -> None:
    """Check a trajectory whose mean speed is allowed, but whose speed between two samples is 1.5 times as high.

    It must reach its end, more slowly, and never exceed the limits by more than 5 %; on a robot in real time, in at
    least one of three attempts.
    """
    _keep_the_limits(robot, arm, partial(_follow_nearby, robot, arm))


def _follow_nearby(robot: Robot, arm: Arm) -> Iterator[Motion[None]]:
    ends = np.stack([arm.positions(), nearby(robot, arm, 0.6)])
    least = float(np.max(np.abs(ends[1] - ends[0]) / arm.model.velocity))
    yield arm.follow(JointTrajectory(arm.joint_names, np.array([0.0, 1.05 * least]), ends, 0.0 * ends))


def _keep_the_limits(
    robot: Robot, group: JointGroup, moves: Callable[[], Iterator[Motion[None]]], scale: float = 1.0, longer: int = 1
) -> None:
    """Require that a motion of ``moves`` succeeds and is never faster than ``scale`` of the limits by more than 5 %.

    ``longer``: over how many times as many readings a speed is a mean in real time.
    """
    simulated = waits_for_sleeps(robot.clock)
    apart = READINGS_APART if simulated else longer * READINGS_APART_IN_REAL_TIME
    limits = scale * group.model.velocity
    tries = []
    for _ in range(1 if simulated else 3):
        for motion in moves():
            places = []
            while not motion.done:
                robot.clock.sleep(UNEVEN)
                places.append((robot.clock.now(), group.positions(), robot.clock.now()))
            ended = f"a motion of {group.name} ended {motion.status}: {motion.failure}"
            require(motion.status is MotionStatus.SUCCEEDED, ended)
            tries.append(_fastest(places, apart))
        if np.all(tries[-1] <= 1.05 * limits):
            return
    raise ConformanceError(
        f"{group.name} moved at {', then at '.join(map(str, tries))}; {scale} of its limits is {limits}"
    )


@each(Arm)
def trajectories_are_followed(robot: Robot, arm: Arm) -> None:
    """Check that trajectories take their duration and stay near their samples."""
    start, end = arm.positions(), nearby(robot, arm, 0.2)
    times = np.linspace(0.0, 1.0, 21)
    share = 3 * times**2 - 2 * times**3
    rate = 6 * times - 6 * times**2
    trajectory = JointTrajectory(
        arm.joint_names, times, start + share[:, None] * (end - start), rate[:, None] * (end - start)
    )
    motion, begin = arm.follow(trajectory), robot.clock.now()
    robot.clock.sleep(0.5)
    early = _due(robot, arm, trajectory, begin)
    at = arm.positions()
    late = _due(robot, arm, trajectory, begin)
    error = float(np.max(np.maximum(np.minimum(early, late) - at, at - np.maximum(early, late))))
    require(error < 0.02, f"half way the arm is {error:.4f} rad off the trajectory")
    finish(robot, motion)
    took = robot.clock.now() - begin
    require(motion.status is MotionStatus.SUCCEEDED, f"follow() ended {motion.status}: {motion.failure}")
    require(0.9 < took < 2.0, f"a trajectory of 1 s took {took:.2f} s")


@each(Arm)
def set_points_are_streamed(robot: Robot, arm: Arm) -> None:
    """Check slow set-points streamed at 20 Hz."""
    start, end = arm.positions(), nearby(robot, arm, 0.1)
    for share in np.linspace(0.05, 1.0, 20):
        arm.servo(start + share * (end - start))
        robot.clock.sleep(0.05)
    robot.clock.sleep(0.2)
    error = float(np.max(np.abs(arm.positions() - end)))
    require(error < 0.01, f"the arm is {error:.4f} rad off the last streamed set-point")


def _due(robot: Robot, arm: Arm, trajectory: JointTrajectory, begin: float) -> NDArray[np.float64]:
    """Return the target position now: by the clock, or by the arm's own report if it may be slower."""
    reported = arm.trajectory_time()
    return trajectory.sample(robot.clock.now() - begin if reported is None else reported)[0]


def _time_of(robot: Robot, command: Callable[[], object]) -> tuple[float, float]:
    """Return the seconds that a command takes, of the robot's clock and of the machine's."""
    start, begin = robot.clock.now(), time.perf_counter()
    command()
    return robot.clock.now() - start, time.perf_counter() - begin


def _groups(robot: Robot) -> list[JointGroup]:
    return parts_of(robot, JointGroup)


def _fastest(places: list[tuple[float, NDArray[np.float64], float]], apart: int) -> NDArray[np.float64]:
    """Return the highest mean speed of each joint between readings so far ``apart``: a ripple within counts for
    nothing.

    Of a place it is known that it was read between two times.
    """
    count = min(apart, len(places) - 1)
    ways = zip(places, places[count:], strict=False)
    return np.asarray(
        np.max([np.abs(end - start) / (after - before) for (before, start, _), (_, end, after) in ways], 0)
    )


MOTION_CHECKS = (
    Check(joints_arrive_within_their_limits, GROUPS, commands=True),
    Check(commands_do_not_block, GROUPS, commands=True),
    Check(a_cancelled_motion_comes_to_rest, GROUPS, commands=True),
    Check(a_motion_is_cancelled_within_a_control_period, GROUPS, commands=True),
    Check(a_command_from_a_second_thread_is_obeyed, GROUPS, commands=True),
    Check(a_newer_command_takes_over, GROUPS, commands=True),
    Check(a_part_at_rest_takes_the_next_command_at_once, commands=True),
    Check(velocities_are_the_rate_of_positions, GROUPS, commands=True),
    Check(set_points_are_held, GROUPS, commands=True),
    Check(velocities_of_joints_lapse, GROUPS, commands=True),
    Check(a_command_after_efforts_starts_from_the_joints, GROUPS, commands=True),
    Check(trajectories_keep_the_limits_between_their_samples, ARMS, commands=True),
    Check(trajectories_are_followed, ARMS, commands=True),
    Check(set_points_are_streamed, ARMS, commands=True),
)


@each(Gripper)
def motions_of_grippers_can_be_cancelled(robot: Robot, gripper: Gripper) -> None:
    """Check that cancelled motions end immediately, and that the fingers come to rest."""
    motion = gripper.move(_other_end(gripper))
    robot.clock.sleep(0.1)
    require(not motion.done, "a motion over the whole range ended within 0.1 s")
    motion.cancel()
    require(motion.status is MotionStatus.CANCELED, f"right after cancel() a motion is {motion.status}")
    robot.clock.sleep(0.5)
    before = gripper.width()
    robot.clock.sleep(0.5)
    moved = abs(gripper.width() - before)
    require(moved < 0.002 and not gripper.state().moving, f"{gripper.name} still moved by {moved:.4f} m")


@each(Gripper)
def a_gripper_opens_and_closes(robot: Robot, gripper: Gripper) -> None:
    """Check that a gripper reaches the requested widths and, closed without an object, reports none."""
    closed, opened = gripper.model.part.min_width, gripper.model.max_width
    middle = (closed + opened) / 2
    for command, width, empty in (
        (gripper.open, opened, False),
        (gripper.close, closed, True),
        (lambda: gripper.move(middle), middle, False),
    ):
        motion = command()
        finish(robot, motion)
        state = gripper.state()
        ended = f"the gripper's motion ended {motion.status}: {motion.failure}"
        require(motion.status is MotionStatus.SUCCEEDED, ended)
        require(abs(gripper.width() - width) < 0.003, f"the width is {gripper.width():.4f}, asked were {width:.4f}")
        require(state.at_target and not state.moving and not state.object_held, f"unexpected state {state}")
        require(state.empty == empty, f"at width {width} the state is {state}")


def _other_end(gripper: Gripper) -> float:
    """Return the width at the end of its range that is farther away."""
    closed, opened = gripper.model.part.min_width, gripper.model.max_width
    return opened if 2 * gripper.width() < closed + opened else closed


GRIPPER_CHECKS = (
    Check(motions_of_grippers_can_be_cancelled, GRIPPERS, commands=True),
    Check(a_gripper_opens_and_closes, GRIPPERS, commands=True),
)
