"""Checks that commands beyond limits, malformed ones and non-finite ones are refused."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from bestman_bt.messages import JointTrajectory
from hal.api import Arm, CommandRefusedError, Gripper, JointGroup, MobileBase, Robot
from hal.conformance.subject import ARMS, BASES, GRIPPERS, GROUPS, Check, each, nearby, require, require_refusal


@each(JointGroup)
def joint_commands_beyond_limits_are_refused(robot: Robot, group: JointGroup) -> None:
    """Check that the message names part, joint, value and limit, and that nothing moves."""
    before = group.positions()
    beyond = before.copy()
    beyond[0] = group.model.upper[0] + 0.5
    words = (group.name, group.joint_names[0], f"{beyond[0]:.4f}", f"{group.model.upper[0]:.4f}")
    require_refusal(lambda: group.move_to(beyond), CommandRefusedError, "a target beyond a limit", words)
    require_refusal(lambda: group.command(positions=beyond), CommandRefusedError, "a set-point beyond a limit", words)
    speeds = 2.0 * group.model.velocity
    require_refusal(lambda: group.command(velocities=speeds), CommandRefusedError, "a velocity beyond a limit")
    efforts = 2.0 * group.model.effort
    require_refusal(lambda: group.command(efforts=efforts), CommandRefusedError, "an effort beyond a limit")
    robot.clock.sleep(0.2)
    moved = float(np.max(np.abs(group.positions() - before)))
    require(moved < 1e-3, f"a refused command moved a joint by {moved:.4f}")


@each(JointGroup)
def malformed_joint_commands_are_refused(robot: Robot, group: JointGroup) -> None:
    """Check wrong shapes, values that are not finite, none or two kinds of set-point, and an invalid speed scale."""
    here = group.positions()
    broken = here.copy()
    broken[-1] = math.nan
    commands = {
        "too few positions": lambda: group.move_to(here[:-1]),
        "NaN": lambda: group.move_to(broken),
        "infinity": lambda: group.command(velocities=np.full(len(here), math.inf)),
        "words": lambda: group.move_to(["a"] * len(here)),
        "no set-point": lambda: group.command(),
        "two set-points": lambda: group.command(positions=here, velocities=0 * here),
        "speed_scale 0": lambda: group.move_to(here, 0.0),
        "speed_scale 2": lambda: group.move_to(here, 2.0),
        "speed_scale NaN": lambda: group.move_to(here, math.nan),
    }
    for what, command in commands.items():
        require_refusal(command, CommandRefusedError, what, (group.name,))


@each(JointGroup)
def a_refused_command_does_not_disturb_the_motion_under_way(robot: Robot, group: JointGroup) -> None:
    """Check that the current motion reaches its target despite a refused command."""
    motion = group.move_to(nearby(robot, group), 0.5)
    robot.clock.sleep(0.1)
    broken = np.full(len(group.joint_names), math.nan)
    require_refusal(lambda: group.move_to(broken), CommandRefusedError, "NaN")
    require(not motion.done, "a refused command should leave the motion under way alone")


@each(Arm)
def trajectories_are_checked(robot: Robot, arm: Arm) -> None:
    """Check that trajectories with wrong joints, limits, speeds or start are refused."""
    here, names = arm.positions(), arm.joint_names
    there = nearby(robot, arm)

    def trajectory(start: np.ndarray, end: np.ndarray, duration: float, joints: tuple[str, ...]) -> JointTrajectory:
        positions = np.stack([start, end])
        return JointTrajectory(joints, np.array([0.0, duration]), positions, np.zeros_like(positions))

    beyond = here.copy()
    beyond[0] = arm.model.upper[0] + 0.1
    commands = {
        "other joints": trajectory(here, there, 2.0, tuple(f"other_{name}" for name in names)),
        "another start": trajectory(there, here, 2.0, names),
        "a sample beyond a limit": trajectory(here, beyond, 10.0, names),
        "a speed beyond a limit": trajectory(here, there, 0.01, names),
    }
    for what, command in commands.items():
        require_refusal(partial(arm.follow, command), CommandRefusedError, f"a trajectory with {what}", (arm.name,))


@each(Arm)
def servo_refuses_jumps(robot: Robot, arm: Arm) -> None:
    """Check that a set-point beyond the velocity limits is refused."""
    jump = np.array(arm.positions())
    jump[0] += 0.5 if jump[0] < (arm.model.lower[0] + arm.model.upper[0]) / 2 else -0.5
    require_refusal(lambda: arm.servo(jump), CommandRefusedError, "a jump of 0.5 rad", (arm.name,))


@each(MobileBase)
def base_commands_beyond_limits_are_refused(robot: Robot, base: MobileBase) -> None:
    """Check speeds above the model's, values that are not finite, and distances that are not above 0."""
    limits = base.model.part
    commands = {
        "vx": lambda: base.set_velocity(limits.max_vx * 1.1, 0.0, 0.0),
        "vy": lambda: base.set_velocity(0.0, limits.max_vy + 0.1, 0.0),
        "wz": lambda: base.set_velocity(0.0, 0.0, -limits.max_wz * 1.1),
        "nan": lambda: base.set_velocity(math.nan, 0.0, 0.0),
        "inf": lambda: base.rotate(math.inf),
        "distance": lambda: base.move_forward(-1.0),
        "0": lambda: base.move_backward(0.0),
    }
    for word, command in commands.items():
        require_refusal(command, CommandRefusedError, f"a base command with wrong {word}", (base.name, word))


@each(Gripper)
def gripper_commands_beyond_limits_are_refused(robot: Robot, gripper: Gripper) -> None:
    """Check that widths, forces and speeds beyond the limits of a gripper are refused."""
    limits = gripper.model.part
    commands = {
        "width": lambda: gripper.move(gripper.model.max_width + 0.01),
        "force": lambda: gripper.move(limits.min_width, force=limits.max_force * 1.1),
        "speed": lambda: gripper.move(limits.min_width, speed=limits.max_speed * 1.1),
        "nan": lambda: gripper.move(math.nan),
        "0": lambda: gripper.move(limits.min_width, force=0.0),
    }
    for word, command in commands.items():
        require_refusal(command, CommandRefusedError, f"a gripper command with wrong {word}", (gripper.name, word))


LIMIT_CHECKS = (
    Check(joint_commands_beyond_limits_are_refused, GROUPS, commands=True),
    Check(malformed_joint_commands_are_refused, GROUPS, commands=True),
    Check(a_refused_command_does_not_disturb_the_motion_under_way, GROUPS, commands=True),
    Check(trajectories_are_checked, ARMS, commands=True),
    Check(servo_refuses_jumps, ARMS, commands=True),
    Check(base_commands_beyond_limits_are_refused, BASES, commands=True),
    Check(gripper_commands_beyond_limits_are_refused, GRIPPERS, commands=True),
)
