"""Checks of ``stop()``: rest within half a second, a latched stop, and no effect of earlier commands afterwards."""

from __future__ import annotations

import threading
from functools import partial

import numpy as np

from bestman_bt.messages import JointTrajectory
from hal.api import Arm, CommandRefusedError, Gripper, JointGroup, MobileBase, MotionErrorCode, MotionStatus, Robot
from hal.conformance.subject import BASES, Check, nearby, parts_of, require, require_refusal, require_rest, set_moving


def stop_brings_everything_to_rest(robot: Robot) -> None:
    """Check that a stop ends motion at full speed within half a second and cancels the motions with the reason."""
    motions = set_moving(robot)
    running = [motion for motion in motions if not motion.done]
    require(bool(running), "the commanded motions should still be running after 0.2 s")
    robot.stop()
    require(robot.stopped, "stop() should latch")
    require_rest(robot, "stop()")
    for motion in running:
        code = motion.failure.code if motion.failure else None
        require(motion.status is MotionStatus.CANCELED, f"a stopped motion is {motion.status}, not CANCELED")
        require(code is MotionErrorCode.STOPPED, f"the error code of a stopped motion is {code}, not STOPPED")


def a_stopped_robot_refuses_commands(robot: Robot) -> None:
    """Check that all commands are refused until the stop is cleared."""
    robot.stop()
    for group in parts_of(robot, JointGroup):
        here = group.positions()
        require_refusal(partial(group.move_to, here), CommandRefusedError, "move_to()")
        require_refusal(partial(group.command, positions=here), CommandRefusedError, "command()")
        if isinstance(group, Arm):
            require_refusal(partial(group.servo, here), CommandRefusedError, "servo()")
            staying = JointTrajectory(
                group.joint_names, np.array([0.0, 1.0]), np.array([here, here]), np.zeros((2, len(here)))
            )
            require_refusal(partial(group.follow, staying), CommandRefusedError, "follow()")
    for base in parts_of(robot, MobileBase):
        require_refusal(partial(base.set_velocity, 0, 0, 0), CommandRefusedError, "set_velocity()")
        require_refusal(partial(base.rotate, 0.1), CommandRefusedError, "rotate()")
        require_refusal(partial(base.move_forward, 0.1), CommandRefusedError, "move_forward()")
    for gripper in parts_of(robot, Gripper):
        require_refusal(gripper.open, CommandRefusedError, "open()", (gripper.name,))
    robot.clear_stop()
    for group in parts_of(robot, JointGroup):
        group.move_to(group.positions())
    for gripper in parts_of(robot, Gripper):
        gripper.open()


def a_stop_stays_until_it_is_cleared(robot: Robot) -> None:
    """Check that neither time nor the stop of a part clears the robot's stop."""
    robot.stop()
    robot.clock.sleep(1.0)
    for part in robot.parts.values():
        part.stop()
    require(robot.stopped, "a stop should stay until clear_stop()")
    for group in parts_of(robot, JointGroup):
        require_refusal(partial(group.move_to, group.positions()), CommandRefusedError, "move_to() a second later")


def stopping_twice_is_stopping_once(robot: Robot) -> None:
    """Check that stopping is idempotent, also at rest; one clear_stop() is enough."""
    robot.stop()
    robot.stop()
    robot.clear_stop()
    require(not robot.stopped, "one clear_stop() should be enough")


def nothing_moves_when_the_stop_is_cleared(robot: Robot) -> None:
    """Check that no earlier command (motion, velocity, streamed set-point) has an effect after a cleared stop."""
    for command in (_drive_away, _turn_all_joints, _stream):
        command(robot)
        robot.stop()
        robot.clock.sleep(0.5)
        places = [(group, group.positions()) for group in parts_of(robot, JointGroup)]
        robot.clear_stop()
        require_rest(robot, "clear_stop()")
        for group, place in places:
            moved = float(np.max(np.abs(group.positions() - place)))
            require(moved < 0.004, f"{group.name} moved by {moved:.4f} when the stop was cleared")


def _drive_away(robot: Robot) -> None:
    set_moving(robot)
    for base in parts_of(robot, MobileBase):
        base.set_velocity(base.model.part.max_vx / 2, 0.0, 0.0)
    robot.clock.sleep(0.1)


def _turn_all_joints(robot: Robot) -> None:
    for group in parts_of(robot, JointGroup):
        way = nearby(robot, group) - group.positions()
        group.command(velocities=np.sign(way) * np.minimum(0.2, group.model.velocity / 2))
    robot.clock.sleep(0.2)


def _stream(robot: Robot) -> None:
    for arm in parts_of(robot, Arm):
        start = arm.positions()
        way = np.sign(nearby(robot, arm) - start) * np.minimum(0.4, arm.model.velocity / 2)
        for step in range(1, 9):
            arm.servo(start + 0.05 * step * way)
            robot.clock.sleep(0.05 if step < 8 else 0.0)


def stop_works_from_another_thread(robot: Robot) -> None:
    """Check a stop from another thread while the clock runs."""
    motions = set_moving(robot)
    thread = threading.Thread(target=robot.stop)
    thread.start()
    robot.clock.sleep(0.05)
    thread.join(timeout=5.0)
    require(robot.stopped, "stop() from another thread should latch")
    require(all(motion.done for motion in motions), "stop() from another thread should end the motions")
    require_rest(robot, "stop() from another thread")


def a_part_can_be_stopped_by_itself(robot: Robot) -> None:
    """Check that a stopped part comes to rest and accepts the next command."""
    base = parts_of(robot, MobileBase)[0]
    base.set_velocity(base.model.part.max_vx / 2, 0.0, 0.0)
    robot.clock.sleep(0.2)
    base.stop()
    require(not robot.stopped, "stopping a part should not latch the robot")
    require_rest(robot, "the base's stop()")
    base.set_velocity(0.0, 0.0, 0.1)


STOP_CHECKS = (
    Check(stop_brings_everything_to_rest, commands=True),
    Check(a_stopped_robot_refuses_commands, commands=True),
    Check(a_stop_stays_until_it_is_cleared),
    Check(stopping_twice_is_stopping_once),
    Check(nothing_moves_when_the_stop_is_cleared, commands=True),
    Check(stop_works_from_another_thread, commands=True),
    Check(a_part_can_be_stopped_by_itself, BASES, commands=True),
)
