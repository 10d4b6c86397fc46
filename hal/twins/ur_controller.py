"""The controller of a UR e-series arm as a state machine over an arm of the twins' world.

The speed slider (``target_speed_fraction``) scales the time of all motion functions, ``servoj`` too, by
``getSpeedScaling() * getTargetSpeedFraction()`` (ur-rtde 1.6.5, ``getSpeedScalingCombined``); an arm that is streamed
set-points faster than that lags behind ("On-Robot speed scaling", ros2_controllers' joint_trajectory_controller).
``target_moment`` ("Target joint moments (torques)", RTDE guide) are the torques with which the controller's model holds
the arm: by joint positions, payload and mounting, without contacts and accelerations. A program that is paused
(``runtime_state`` 4) holds the arm, and continues the same motion when it is played. Reduced mode (``safety_mode``
2) is reported, and limits nothing.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from bestman_bt.messages import Wrench
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.payload import flange_of, payload
from hal.api import Arm, ForceTorque
from hal.twins.ur_kinematics import URKinematics
from hal.twins.ur_program import URProgram
from hal.twins.world import TwinWorld

STOPPED, PLAYING, PAUSED = 1, 2, 4
UNLOCK_DELAY = 5.0
"""Seconds after a protective stop before which it cannot be unlocked."""
TRACKING_TOLERANCE = 0.12
TRACKING_TIME = 0.1


class RobotMode(IntEnum):
    """Numbers of ``robot_mode``."""

    POWER_OFF = 3
    IDLE = 5
    RUNNING = 7


class SafetyMode(IntEnum):
    """Numbers of ``safety_mode``."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    SAFEGUARD_STOP = 5
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8


_SAFETY_BITS = {
    SafetyMode.NORMAL: 1 << 0,
    SafetyMode.REDUCED: 1 << 1,
    SafetyMode.PROTECTIVE_STOP: 1 << 2,
    SafetyMode.SAFEGUARD_STOP: 1 << 4 | 1 << 10,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10,
    SafetyMode.VIOLATION: 1 << 8 | 1 << 10,
}


class URController:
    """Called by the protocol servers from their threads; touches the robot only in the world's thread (``tick``)."""

    def __init__(self, world: TwinWorld, arm: Arm, sensor: ForceTorque | None, model: RobotModel) -> None:
        self._world, self._arm, self._sensor = world, arm, sensor
        self._kinematics = URKinematics(model, arm.name)
        self.robot_mode, self.safety_mode = RobotMode.RUNNING, SafetyMode.NORMAL
        self._program: URProgram | None = None
        self._inputs: dict[str, Any] = {}
        self._arriving: deque[tuple[float, Sequence[Mapping[str, Any]]]] = deque()
        self._written = time.monotonic()
        self._cycles_since = 0.0  # seconds of cycles since then
        self._tripped = -UNLOCK_DELAY
        self._astray = 0.0
        self._digital_outputs = 0
        self._payload = self._hand = payload(model, flange_of(model, arm.name)).mass  # as set at the pendant
        self._slider, self._paused = 1.0, False
        self._wrench_sign = 1.0
        self._gravity_sign = 1.0  # of the controller's model; the arm of the world stays as it is
        self._measured: dict[str, Any] = {}
        world.ticks.append(self.tick)

    @property
    def playing(self) -> bool:
        """Return whether a program runs."""
        return self._program is not None

    def read(self) -> Mapping[str, Any]:
        """Return the current output fields."""
        return {
            **self._measured,
            "timestamp": time.monotonic(),
            "robot_mode": int(self.robot_mode),
            "safety_mode": int(self.safety_mode),
            "safety_status_bits": _SAFETY_BITS[self.safety_mode],
            "robot_status_bits": 1 | (2 if self.playing else 0),
            "runtime_state": STOPPED if not self.playing else PAUSED if self._paused else PLAYING,
            "speed_scaling": 1.0,
            "target_speed_fraction": self._slider,
            "payload": self._payload,
            "actual_digital_output_bits": self._digital_outputs,
        }

    def write(self, due: float, inputs: Sequence[Mapping[str, Any]]) -> None:
        """Apply inputs together in the first cycle after ``due``; later ones replace earlier ones."""
        self._arriving.append((due, inputs))

    def upload(self, script: str) -> None:
        """Replace the running program, as by the script port; without power or after a stop it is ignored."""
        if "read_input_integer_register" not in script:
            return  # other people's programs do nothing in the twin

        def begin() -> None:
            self._end_program()
            if self.robot_mode == RobotMode.RUNNING and self.safety_mode in (SafetyMode.NORMAL, SafetyMode.REDUCED):
                self._program = URProgram(script, self._arm, self._kinematics)

        self._world.post(begin)

    def lengthen(self, length: float) -> None:
        """Lengthen the real arm along the flange's axis, metres; the controller's kinematics do not change."""
        self._kinematics.length_error = length

    def end_program(self) -> None:
        """Press the Stop button."""
        self._world.post(self._end_program)

    def set_slider(self, share: float) -> None:
        """Move the speed slider of the pendant to the fraction ``share``, 0 to 1."""
        self._slider = share

    def pause(self, paused: bool) -> None:
        """Press the Pause or Play button."""

        def change() -> None:
            if paused == self._paused:
                return
            self._paused = paused
            if self._program is not None and paused:
                self._program.pause()
            elif self._program is not None:
                self._program.resume()

        self._world.post(change)

    def reduce(self, reduced: bool) -> None:
        """Switch reduced mode on or off by the safety input."""
        self.safety_mode = SafetyMode.REDUCED if reduced else SafetyMode.NORMAL

    def mount(self, upside_down: bool) -> None:
        """Set the mounting in the installation to that of the robot file, or the opposite."""
        self._gravity_sign = -1.0 if upside_down else 1.0

    def turn_wrench(self) -> None:
        """Invert the sign of the wrench sensor; a second call restores it."""
        self._wrench_sign = -self._wrench_sign

    def trip(self, mode: SafetyMode) -> None:
        """Make the safety system stop the robot and end the program."""

        def stop() -> None:
            self.safety_mode, self._tripped = mode, time.monotonic()
            self._end_program()

        self._world.post(stop)

    def unlock(self) -> bool:
        """Release a protective stop. Returns whether that was possible."""
        if self.safety_mode == SafetyMode.PROTECTIVE_STOP and time.monotonic() < self._tripped + UNLOCK_DELAY:
            return False
        if self.safety_mode == SafetyMode.PROTECTIVE_STOP:
            self.safety_mode = SafetyMode.NORMAL
        return True

    def be_released(self) -> None:
        """Release the arm at the pendant, as after an inspection: no buttons pressed, power on, brakes open."""
        self.safety_mode, self.robot_mode = SafetyMode.NORMAL, RobotMode.RUNNING

    def restart_safety(self) -> None:
        """Restart the safety system after a violation; the arm is then without power."""
        self.safety_mode, self.robot_mode = SafetyMode.NORMAL, RobotMode.POWER_OFF
        self.end_program()

    def power(self, on: bool) -> None:
        """Switch the arm's power on, with closed brakes, or off."""
        self.robot_mode = RobotMode.IDLE if on else RobotMode.POWER_OFF
        if not on:
            self.end_program()

    def release_brakes(self) -> None:
        """Open the brakes."""
        if self.robot_mode == RobotMode.IDLE:
            self.robot_mode = RobotMode.RUNNING

    def tick(self, dt: float) -> None:
        """Prepare the next physics step of the world.

        The tool is powered through the arm, which an emergency stop leaves without power (UR's user manual, "Tool I/O"
        and "Emergency stop").
        """
        powered = self.robot_mode != RobotMode.POWER_OFF and self.safety_mode != SafetyMode.ROBOT_EMERGENCY_STOP
        (self._world.without_power.discard if powered else self._world.without_power.add)(self._arm.name)
        arrived = self._take_inputs(dt)
        program = self._program
        if program is not None:
            if not self._paused:
                program.advance(dt, self._inputs, arrived, self._slider)
            self._watch(program, dt)
        if program is not None and program.payload is not None:
            self._payload = program.payload
        self._measure(program)

    def _take_inputs(self, dt: float) -> Sequence[Mapping[str, Any]]:
        """Write what has arrived into the registers. Returns their contents after each command."""
        now, arrived = time.monotonic(), []
        self._cycles_since += dt
        while self._arriving and self._arriving[0][0] <= now:
            for values in self._arriving.popleft()[1]:
                self._inputs.update(values)
                self._set_outputs(values)
                if "input_int_register_0" in values:
                    self._written, self._cycles_since = now, 0.0
                    arrived.append(dict(self._inputs))
        return arrived

    def _set_outputs(self, values: Mapping[str, Any]) -> None:
        """Set the digital outputs: 8 standard, 8 configurable, 2 of the tool."""
        for kind, shift in (("standard", 0), ("configurable", 8), ("tool", 16)):
            mask = values.get(f"{kind}_digital_output_mask")
            if mask is not None:
                bits = values[f"{kind}_digital_output"] & mask
                self._digital_outputs = self._digital_outputs & ~(mask << shift) | bits << shift

    def _watch(self, program: URProgram, dt: float) -> None:
        """End a program that has finished, or for its watchdog, a jump of set-points, or an obstructed joint."""
        frequency = program.watchdog_frequency
        # By the clock and by cycles, so that neither a pause of this process nor its catching up counts as silence.
        silence = min(time.monotonic() - self._written, self._cycles_since)
        if program.ended or (frequency and silence > 1.0 / frequency):
            self._end_program()
        follower = program.follower
        astray = follower is not None and bool(
            np.any(np.abs(follower.setpoint - self._arm.positions()) > TRACKING_TOLERANCE)
        )
        self._astray = self._astray + dt if astray else 0.0
        if program.limit_exceeded:
            self._stop_for(SafetyMode.VIOLATION, "a set-point beyond a joint limit")
        elif follower is not None and follower.too_fast:
            self._stop_for(SafetyMode.PROTECTIVE_STOP, "a sudden change of the set-point")
        elif self._astray > TRACKING_TIME:
            self._stop_for(SafetyMode.PROTECTIVE_STOP, "the position deviates from the set-point")
        elif program.protective_stop_asked:
            self._stop_for(SafetyMode.PROTECTIVE_STOP, "the program asked for it")

    def _stop_for(self, mode: SafetyMode, reason: str) -> None:
        self._world.watch.report(f"{self._arm.name}: {mode.name.lower().replace('_', ' ')}: {reason}")
        self.trip(mode)

    def _signed(self, wrench: Wrench) -> tuple[float, ...]:
        values = self._wrench_sign * np.concatenate([wrench.force, wrench.torque])
        return tuple(values.tolist())

    def _end_program(self) -> None:
        if self._program is not None:
            self._program.halt()
        self._program, self._astray, self._paused = None, 0.0, False
        self._inputs["input_int_register_0"] = 0

    def _measure(self, program: URProgram | None) -> None:
        arm = self._arm
        positions, velocities = arm.positions(), arm.velocities()
        at_rest = (0.0,) * len(positions)
        pose = self._kinematics.pose(positions)
        torques = self._kinematics.holding_torques(positions, self._payload - self._hand)
        wrench = self._sensor.wrench() if self._sensor is not None else None
        follower = program.follower if program is not None else None
        self._measured = {
            "actual_q": tuple(positions.tolist()),
            "actual_qd": tuple(velocities.tolist()),
            "target_q": tuple((follower.setpoint if follower is not None else positions).tolist()),
            "target_qd": tuple(velocities.tolist()) if follower is not None else at_rest,
            "target_moment": tuple((self._gravity_sign * torques).tolist()),
            "actual_TCP_pose": pose,
            "target_TCP_pose": pose,
            **({"ft_raw_wrench": self._signed(wrench)} if wrench is not None else {}),
            **(program.outputs if program is not None else {"output_int_register_0": 0}),
        }
