"""A UR arm: streamed set-points as for every arm, and motions that the controller plans itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.robot_model.model import ArmModel
from hal.api import Failure, Motion, MotionErrorCode
from hal.parts.channels import JointChannel
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.setpoints import Setpoints, Trapezoid
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_arm import StreamedArm
from hal.ur.link import URLink
from hal.ur.sdk_process import PROGRAM_TIME, Report

Array = NDArray[np.float64]
START_TIME, STOP_TIME = 1.0, 2.0
"""Seconds within which the controller has to begin and to end a motion that it interpolates."""
UPLOAD_TIME = 2.0 * PROGRAM_TIME + 1.0
"""Seconds within which a program with a path has to start; nothing moves meanwhile."""
RENEWAL = 0.05
"""Period of renewing a motion, seconds; the SDK's process stops motions that are not renewed."""
TOOL_ACCELERATION = 1.0
ARRIVED = 0.01
SPEED_MARGIN = 1.1
AT_LEAST = 0.1
"""Minimum duration of a motion, seconds, so that older readings do not end it."""


@dataclass(eq=False)
class _OwnMotion:
    """A motion that the controller plans: how to begin and stop it, and when it is over."""

    motion: Motion[None]
    begin: Callable[[], object]
    stop_call: str
    over: Callable[[Report, float], bool]  # of the newest report and the seconds since it began
    target: Array | None = None
    prepare: Callable[[], object] | None = None  # takes its time; a stop meanwhile keeps it from beginning
    begun: float | None = None
    renewed: float = 0.0
    stopping: bool = False


class URArm(StreamedArm):
    """An arm controlled by ur-rtde.

    ``move_path``, ``speed_joints`` and ``speed_tool`` are the controller's ``movej``, ``speedj`` and ``speedl``, within
    the same limits as all motions. They do not replace one another: call ``stop`` or ``cancel`` first. They follow the
    speed slider, wait while the controller is paused, and run at the ``speed_share`` of their start. Motions of the
    controller are renewed every 0.05 s, and end without renewal.
    """

    def __init__(
        self,
        name: str,
        model: ArmModel,
        channel: JointChannel,
        latch: StopLatch,
        period: float,
        tool: ToolLimits,
        link: URLink,
    ) -> None:
        super().__init__(name, model, channel, latch, period, tool)
        self._link = link
        self._own: _OwnMotion | None = None

    def move_path(self, positions: ArrayLike, speed_scale: float = 1.0, blend: float = 0.0) -> Motion[None]:
        """Move through joint positions (N, 6), radians, with a ``blend`` radius in metres at all but the last."""
        with self._connection.lock:
            self._connection.check_command("move_path")
            rows = [self._checks.positions("move_path", row) for row in np.atleast_2d(np.asarray(positions, float))]
            scale = self._checks.speed_scale("move_path", speed_scale)
            speed, acceleration = scale * float(min(self.model.velocity)), scale * float(min(self.model.acceleration))
            share, start = 1.0, self.positions()
            for row in rows:
                fault = self._tool.outside_on_the_way(start, row)
                if fault is not None:
                    raise self._connection.refuse("move_path", fault)
                profile = Trapezoid(start, row, np.full(len(row), speed), np.full(len(row), acceleration))
                share, start = min(share, self._slow_down(profile)), row
            numbers = (speed * share, acceleration * share**2)
            blends = [blend] * (len(rows) - 1) + [0.0]

            def upload() -> object:
                """Upload the path at the operator's current fraction of the speed."""
                now = self.speed_share
                moving = numbers[0] * now, numbers[1] * now**2
                path = [[*row.tolist(), *moving, round_off] for row, round_off in zip(rows, blends, strict=True)]
                return self._link.call("upload_path", path, timeout=UPLOAD_TIME)

            return self._begin_own(
                "move_path",
                lambda: self._link.call("start_path", timeout=START_TIME),
                "stop_path",
                lambda report, passed: not report.moving,
                rows[-1],
                upload,
            )

    def speed_joints(self, velocities: ArrayLike, duration: float) -> Motion[None]:
        """Move the joints at velocities (6,), rad/s, for ``duration`` seconds, then come to rest."""
        with self._connection.lock:
            self._connection.check_command("speed_joints")
            wanted = self._checks.velocities("speed_joints", velocities)
            if self._tool.slow_down(self.positions()[None], wanted[None]) < 1.0:
                raise self._connection.refuse("speed_joints", "the tool would be faster than its limit")
            acceleration = float(min(self.model.acceleration))
            return self._begin_speed("speed_joints", wanted.tolist(), acceleration, float(duration))

    def speed_tool(self, twist: ArrayLike, duration: float) -> Motion[None]:
        """Move the tool at (vx, vy, vz, wx, wy, wz), m/s and rad/s in the arm's base frame, for ``duration`` seconds.

        The tool is the controller's: the flange, unless another was set at its teach pendant.
        """
        with self._connection.lock:
            self._connection.check_command("speed_tool")
            wanted = np.asarray(twist, float)
            if wanted.shape != (6,) or not np.all(np.isfinite(wanted)):
                raise self._connection.refuse("speed_tool", "the twist should be six finite numbers")
            limit = self._tool.top_speed
            if limit is not None and float(np.linalg.norm(wanted[:3])) > limit:
                raise self._connection.refuse("speed_tool", "the tool would be faster than its limit")
            # The controller counts x and y of its base the other way round than the URDF does.
            turned = wanted * np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
            return self._begin_speed("speed_tool", turned.tolist(), TOOL_ACCELERATION, float(duration))

    @property
    def resting(self) -> bool:
        """Return whether no motion is commanded."""
        return self._own is None and super().resting

    @override
    def brake(self) -> None:
        with self._connection.lock:
            if self._own is not None:
                self._own.stopping = True
            else:
                super().brake()

    def fail(self, fault: Failure) -> None:
        """Fail the current motion; the controller has stopped the arm or cannot be reached."""
        with self._connection.lock:
            if self._own is not None:
                self._own.stopping = True  # a fault of the link leaves the controller moving
            super().fail(fault)

    def attach(self) -> None:
        """Hold the joints at their current positions."""
        with self._connection.lock:
            self._own = None
            super().attach()

    def cycle(self, elapsed: float) -> None:
        """Execute one control period."""
        with self._connection.lock:  # so that no motion of the controller's begins between the look and the cycle
            own = self._own
            if own is None:
                super().cycle(elapsed)
                return
        self._attend(own)
        self.record()

    def _begin_speed(self, call: str, speeds: list[float], acceleration: float, duration: float) -> Motion[None]:
        if not (np.isfinite(duration) and duration > 0.0):
            raise self._connection.refuse(call, f"duration = {duration} s is not positive")
        return self._begin_own(
            call,
            lambda: self._link.call(
                call, [self.speed_share * speed for speed in speeds], acceleration, timeout=START_TIME
            ),
            "stop_speed",
            lambda report, passed: passed > duration,
        )

    def _begin_own(
        self,
        call: str,
        begin: Callable[[], object],
        stop_call: str,
        over: Callable[[Report, float], bool],
        target: Array | None = None,
        prepare: Callable[[], object] | None = None,
    ) -> Motion[None]:
        if not self.resting:
            raise self._connection.refuse(call, "the arm still moves")
        motion: Motion[None] = Motion(self.name, self.brake)
        self._connection.begin(motion)
        self._own = _OwnMotion(motion, begin, stop_call, over, target, prepare)
        return motion

    def _attend(self, own: _OwnMotion) -> None:
        """Serve the controller from the connection's loop, the only one that talks to it, without holding a lock."""
        report = self._link.report
        try:
            if own.begun is None:
                if self.speed_share == 0.0 and not own.stopping:
                    return  # while the operator holds the robot, nothing begins
                prepare, own.prepare = own.prepare, None
                if prepare is not None and not own.stopping:
                    prepare()
                    return
                if not own.stopping:
                    own.begin()
                own.begun = own.renewed = time.monotonic()
                return
            wrong = self._wrong(report) if report is not None else None
            if wrong is not None:
                own.motion.fail(MotionErrorCode.FAULT, wrong)
            passed = time.monotonic() - own.begun
            over = report is not None and passed > AT_LEAST and own.over(report, passed)
            if not (own.stopping or over or wrong is not None):
                self._renew(own)
                return
            arrived = over and own.stop_call == "stop_path"
            self._link.call("end_path" if arrived else own.stop_call, timeout=STOP_TIME)
        except ConnectionFailedError as error:
            own.motion.fail(MotionErrorCode.FAULT, str(error))
        self._leave(own)

    def _renew(self, own: _OwnMotion) -> None:
        if time.monotonic() - own.renewed > RENEWAL:
            self._link.call("renew", timeout=STOP_TIME)
            own.renewed = time.monotonic()

    def _wrong(self, report: Report) -> str | None:
        fast = np.abs(report.velocities) > SPEED_MARGIN * self.model.velocity
        if np.any(fast):
            return f"{self.joint_names[int(np.argmax(fast))]} is faster than its limit"
        return self._tool.outside(np.array(report.positions))

    def _leave(self, own: _OwnMotion) -> None:
        with self._connection.lock:
            if self._own is not own:
                return
            measured = self._channel.read().positions
            if own.target is None or float(np.max(np.abs(measured - own.target))) < ARRIVED:
                own.motion.succeed()
            else:
                own.motion.fail(MotionErrorCode.FAULT, "the path ended elsewhere")
            self._own = None
            self._rest_at(measured)

    def _take_over(self, setpoints: Setpoints, motion: Motion[None] | None) -> None:
        if self._own is not None:
            raise self._connection.refuse("a command", "the controller moves it; stop() it first")
        super()._take_over(setpoints, motion)
