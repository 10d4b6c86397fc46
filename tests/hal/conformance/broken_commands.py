"""Limits and motions that break a promise."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np

from bestman_bt.messages import JointTrajectory
from hal.api import CommandRefusedError, Motion, MotionErrorCode, MotionStatus
from tests.hal.conformance.changed_robot import Break, OneMotion, OnlySaysSo, changed, of, wrapped


class ChangesItsMind(OneMotion):
    """A second ``cancel`` makes it a failure."""

    cancels = 0

    @property
    def status(self) -> MotionStatus:
        return MotionStatus.FAILED if self.cancels > 1 else self.motion.status

    def cancel(self) -> None:
        self.cancels += not self.motion.done or self.cancels > 0
        self.motion.cancel()


def late_to_cancel(robot: Any) -> None:
    class Late(OnlySaysSo):
        delay, clock = 0.3, robot.clock

    of("arm", "move_to", lambda do, *a: Late(do(*a)))(robot)


def shortened(robot: Any) -> None:
    """Set-points of positions are reached to eight tenths."""
    arm = robot.parts["arm"]

    def command(do: Any, positions: Any = None, **others: Any) -> None:
        if positions is not None and arm.resting and not robot.stopped and robot.connected:
            arm._checks.positions("command", positions)
            positions = arm.positions() + 0.8 * (np.asarray(positions) - arm.positions())
        do(positions, **others)

    wrapped(arm, "command", command)


def clipped_set_points(robot: Any) -> None:
    arm = robot.parts["arm"]

    def command(do: Any, positions: Any = None, **others: Any) -> None:
        do(None if positions is None else np.clip(positions, arm.model.lower, arm.model.upper), **others)

    wrapped(arm, "command", command)


def forgiving_speed_scale(do: Any, positions: Any, scale: float = 1.0) -> Motion:
    return do(positions, scale if 0.0 < scale <= 1.0 else 1.0)


def disturbing(robot: Any) -> None:
    arm = robot.parts["arm"]

    def move_to(do: Any, *arguments: Any) -> Motion:
        try:
            return do(*arguments)
        except CommandRefusedError:
            arm.stop()
            raise

    wrapped(arm, "move_to", move_to)


def forgiving_follow(robot: Any) -> None:
    arm = robot.parts["arm"]

    def follow(do: Any, trajectory: JointTrajectory) -> Motion:
        try:
            return do(trajectory)
        except CommandRefusedError:
            return arm.move_to(arm.positions())

    wrapped(arm, "follow", follow)


def slow_follow(do: Any, way: JointTrajectory) -> Motion:
    return do(JointTrajectory(way.joint_names, 1.5 * way.times, way.positions, way.velocities / 1.5))


def forgiving_servo(robot: Any) -> None:
    arm = robot.parts["arm"]

    def servo(do: Any, positions: Any) -> None:
        try:
            do(positions)
        except CommandRefusedError:
            arm.command(positions)

    wrapped(arm, "servo", servo)


def forgiving_base(robot: Any) -> None:
    limit = robot.parts["base"].model.part.max_vx
    wrapped(robot.parts["base"], "set_velocity", lambda do, vx, vy, wz: do(np.clip(vx, -limit, limit), vy, wz))


def forgiving_gripper(robot: Any) -> None:
    limit = robot.parts["gripper"].model.max_width
    wrapped(robot.parts["gripper"], "move", lambda do, width, *a, **k: do(min(width, limit), *a, **k))


def blocking_gripper(robot: Any) -> None:
    def move(do: Any, *arguments: Any, **keywords: Any) -> Motion:
        motion = do(*arguments, **keywords)
        robot.clock.sleep(0.06)
        return motion

    wrapped(robot.parts["gripper"], "move", move)


def waiting_gripper(robot: Any) -> None:
    """For the machine's time; the robot's stands still meanwhile."""

    def close(do: Any, *arguments: Any, **keywords: Any) -> Motion:
        time.sleep(0.2)
        return do(*arguments, **keywords)

    wrapped(robot.parts["gripper"], "close", close)


def bound_to_one_thread(do: Any, *arguments: Any) -> Motion:
    if threading.current_thread() is not threading.main_thread():
        raise CommandRefusedError("arm takes no commands from this thread")
    return do(*arguments)


def busy_for_a_moment_after_it_has_arrived(robot: Any) -> None:
    arm = robot.parts["arm"]
    ended = [-np.inf]

    def cycle(do: Any, elapsed: float) -> None:
        moved = arm._connection.motion is not None
        do(elapsed)
        if moved and arm._connection.motion is None:
            ended[0] = robot.clock.now()

    def move_to(do: Any, *arguments: Any) -> Motion:
        if robot.clock.now() - ended[0] < 0.015:
            raise CommandRefusedError("arm refused move_to: it still moves")
        return do(*arguments)

    wrapped(arm, "cycle", cycle)
    wrapped(arm, "move_to", move_to)


def never_superseded(robot: Any) -> None:
    line = robot.parts["arm"]._connection

    def begin(do: Any, motion: Any) -> None:
        line.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "somebody else wanted it")
        do(motion)

    wrapped(line, "begin", begin)


def never_lapsing(robot: Any) -> None:
    base = robot.parts["base"]

    def set_velocity(do: Any, *velocity: float) -> None:
        do(*velocity)
        base._lapses_in = np.inf

    wrapped(base, "set_velocity", set_velocity)


def joints_never_lapsing(robot: Any) -> None:
    arm = robot.parts["arm"]
    arm._tracking = replace(arm._tracking, velocity_timeout=np.inf)


def holding_on_to_old_set_points(robot: Any) -> None:
    """Of an arm that efforts move, by a little."""
    arm = robot.parts["arm"]

    def exert(channel: Any, efforts: np.ndarray) -> None:
        channel.send(channel.read().positions - 0.04, 0.0 * efforts)

    changed(arm._channel, takes_efforts=True, exert=exert)
    wrapped(arm, "_leave_effort_mode", lambda do: setattr(arm, "_efforts", None))


def without_a_gate(robot: Any) -> None:
    """Set-points go out as they come, and trajectories at their own pace."""
    arm = robot.parts["arm"]
    wrapped(arm, "_joint_pace", lambda do, *a: 1.0)
    wrapped(arm._gate, "_objection", lambda do, *a: "")


def velocity_in_the_odometry_frame(robot: Any) -> None:
    base = robot.parts["base"]

    def velocity(do: Any) -> Any:
        v, heading = do(), base.odometry().theta
        turned = complex(v.vx, v.vy) * np.exp(1j * heading)
        return replace(v, vx=turned.real, vy=turned.imag)

    wrapped(base, "velocity", velocity)


BROKEN: list[tuple[str, Break]] = [
    ("joint commands beyond limits are refused", clipped_set_points),
    ("malformed joint commands are refused", of("arm", "move_to", forgiving_speed_scale)),
    ("a refused command does not disturb the motion under way", disturbing),
    ("trajectories are checked", forgiving_follow),
    ("servo refuses jumps", forgiving_servo),
    ("base commands beyond limits are refused", forgiving_base),
    ("gripper commands beyond limits are refused", forgiving_gripper),
    ("gripper commands beyond limits are refused", of("gripper", "move", lambda do, width, *others, **more: do(width))),
    (
        "joints arrive within their limits",
        of("arm", "move_to", lambda do, at, s=1.0: do(at, min(1.5 * s, 1) if s < 1 else s)),
    ),
    ("commands do not block", blocking_gripper),
    ("commands do not block", waiting_gripper),
    ("a cancelled motion comes to rest", of("arm", "move_to", lambda do, *a: ChangesItsMind(do(*a)))),
    ("a motion is cancelled within a control period", late_to_cancel),
    ("motions of grippers can be cancelled", of("gripper", "move", lambda do, *a, **k: OnlySaysSo(do(*a, **k)))),
    ("a command from a second thread is obeyed", of("arm", "move_to", bound_to_one_thread)),
    ("a part at rest takes the next command at once", busy_for_a_moment_after_it_has_arrived),
    ("a newer command takes over", never_superseded),
    ("velocities are the rate of positions", of("arm", "velocities", lambda do: 1.5 * do())),
    ("velocities are the rate of positions", of("head", "velocities", lambda do: np.degrees(do()))),
    ("set points are held", shortened),
    ("trajectories are followed", of("arm", "follow", slow_follow)),
    ("set points are streamed", of("arm", "servo", lambda do, positions: do(np.asarray(positions) + 0.02))),
    ("a gripper opens and closes", of("gripper", "state", lambda do: replace(do(), empty=False))),
    ("velocities of joints lapse", joints_never_lapsing),
    ("a command after efforts starts from the joints", holding_on_to_old_set_points),
    ("trajectories keep the limits between their samples", without_a_gate),
    ("velocities of a base lapse", never_lapsing),
    ("a base moves in its own frame", velocity_in_the_odometry_frame),
    ("a base drives and turns by odometry", of("base", "move_forward", lambda do, distance: do(1.05 * distance))),
    ("a motion of a base can be cancelled", of("base", "rotate", lambda do, angle: OnlySaysSo(do(angle)))),
]
