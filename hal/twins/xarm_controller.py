"""The control box of an xArm as a state machine over the arm and the gripper of the twins' world.

It starts as set in UFACTORY Studio, with its motors on. After an error they are off, and clearing it
does not switch them on: "need to be manually enabled motion(arm.motion_enable(True)) and set
state(arm.set_state(state=0)) after clean error" (xarm-python-sdk 1.18, ``XArmAPI.clean_error``).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from hal.api import Arm, Gripper, Motion
from hal.twins.servo_follower import ServoFollower
from hal.twins.world import TwinWorld

Array = NDArray[np.float64]
POSITION_MODE, SERVO_MODE = 0, 1
COLLISION_ERROR, JOINT_LIMIT_ERROR, SPEED_ERROR = 31, 23, 24
GRIPPER_OVERLOAD = 34
TRACKING_TOLERANCE = 0.12
TRACKING_TIME = 0.1
PULSES = 850
FASTEST_TURNS = 5000


class State(IntEnum):
    """The controller's state."""

    MOVING = 1
    SLEEPING = 2
    PAUSED = 3
    STOPPED = 4


@dataclass(frozen=True, eq=False)
class XArmReading:
    """The controller's readings of its joints, (n,) each, and the gripper's position in pulses."""

    positions: Array
    velocities: Array
    efforts: Array
    pulses: int


class XArmController:
    """Called by the protocol server from its threads; touches the robot only in the world's thread (``tick``)."""

    def __init__(self, world: TwinWorld, arm: Arm, gripper: Gripper | None, is_lite6: bool = False) -> None:
        self._world, self._arm, self._gripper = world, arm, gripper
        self.is_lite6 = is_lite6
        self.axes = len(arm.joint_names)
        self.mode, self.state, self.error, self.warning = POSITION_MODE, State.SLEEPING, 0, 0
        self.enabled = True
        self.reduced = False
        self.reduced_joint_speed = self.reduced_tool_speed = 0.0
        self.gripper_enabled = False
        self.gripper_error = 0
        self.gripper_turns = FASTEST_TURNS
        self._jammed = False
        self._turned: tuple[int, float] | None = None
        self._lower = arm.model.lower
        self._upper = arm.model.upper
        self._speed = arm.model.velocity
        self._follower: ServoFollower | None = None
        self._motion: Motion[None] | None = None
        self._astray = 0.0
        zero = np.zeros(self.axes)
        self.reading = XArmReading(zero, zero, zero, 0)
        world.ticks.append(self.tick)

    def enable(self, on: bool) -> None:
        """Switch the motors on or off."""
        self.enabled = on
        if not on:
            self.set_state(int(State.STOPPED))

    def set_mode(self, mode: int) -> None:
        """Set mode 0 (position) or 1 (servo); motion ends, and ``set_state(0)`` has to follow."""
        self.halt()
        self.mode = mode

    def set_state(self, asked: int) -> None:
        """Set state 0 (ready), 3 (pause) or 4 (stop)."""
        if asked == 0:
            if self.enabled and not self.error:
                self.state = State.SLEEPING
        elif asked == 3:
            self.state = State.PAUSED
        elif asked == 4:
            self.state = State.STOPPED
        if asked:
            self.halt()

    def clear_error(self) -> None:
        """Clear the error; the state remains STOPPED."""
        self.error = 0

    def trip(self, error: int) -> None:
        """Trigger an error: everything stops, and the motors are switched off."""
        self.error, self.enabled = error, False
        self.state = State.STOPPED
        self.halt()

    def be_released(self) -> None:
        """Press *Clear error* and *Enable robot* in UFACTORY Studio, as after an inspection."""
        self.clear_error()
        self.enable(True)
        self.set_state(0)

    def halt(self) -> None:
        """Bring the arm to rest; the gripper keeps its state."""
        self._world.post(self._halt)

    def servo(self, positions: Array) -> bool:
        """Set a streamed set-point (n,), radians. Returns whether it was accepted."""
        if self.mode != SERVO_MODE or not self._ready():
            return False
        if np.any(positions < self._lower - 1e-3) or np.any(positions > self._upper + 1e-3):
            self.trip(JOINT_LIMIT_ERROR)
            return False
        goal, arrived = np.clip(positions, self._lower, self._upper), time.monotonic()
        self._world.post(lambda: self._take(goal, arrived))
        return True

    def move(self, positions: Array, speed: float) -> bool:
        """Move point to point in position mode, at ``speed`` rad/s; return whether the command was accepted. A newer
        one replaces it.
        """
        if self.mode != POSITION_MODE or not self._ready():
            return False
        if np.any(positions < self._lower - 1e-3) or np.any(positions > self._upper + 1e-3):
            self.trip(JOINT_LIMIT_ERROR)
            return False
        share = float(np.clip(speed / float(np.max(self._speed)), 0.01, 1.0))
        target = np.clip(positions, self._lower, self._upper)

        def begin() -> None:
            self._motion = self._arm.move_to(target, share)

        self._world.post(begin)
        return True

    def turn(self, joint: int | None) -> None:
        """Invert a joint's motion in servo mode from its current position, as with a wrong drive sign; None: no
        joint.
        """

        def begin() -> None:
            self._turned = None if joint is None else (joint, float(self._arm.positions()[joint]))

        self._world.post(begin)

    @property
    def commands_left(self) -> int:
        """Return the number of active motions."""
        motion = self._motion
        return int(motion is not None and not motion.done)

    def move_gripper(self, pulses: int) -> None:
        """Move to a position of 0 (closed) to 850 (open)."""
        gripper = self._gripper
        if gripper is None or not self.gripper_enabled:
            return
        if self._jammed:
            self.gripper_error = GRIPPER_OVERLOAD
            return
        share = float(np.clip(pulses / PULSES, 0.0, 1.0))
        pace = float(np.clip(self.gripper_turns / FASTEST_TURNS, 0.05, 1.0))
        self._world.post(lambda: self._move_gripper(gripper, share, pace))

    def power_gripper(self, share: float | None) -> None:
        """Drive the gripper of a Lite 6, which is controlled only by its power, to 0 (closed) or 1 (open) of its width;
        None: no power.
        """
        gripper = self._gripper
        if gripper is None or self._jammed:
            return
        self._world.post(gripper.stop if share is None else lambda: self._move_gripper(gripper, share, 1.0))

    def jam(self) -> None:
        """Block the gripper's fingers until ``unjam``; the motor detects it while moving them."""
        self._jammed = True
        gripper = self._gripper
        if gripper is not None:
            self._world.post(lambda: self._block_gripper(gripper))

    def unjam(self) -> None:
        """Release the fingers; an error stays until it is cleared."""
        self._jammed = False

    def tick(self, dt: float) -> None:
        """Prepare the next physics step of the world."""
        arm = self._arm
        positions = arm.positions()
        self.reading = XArmReading(positions, arm.velocities(), arm.efforts(), self._pulses())
        follower = self._follower
        if self.mode == SERVO_MODE and follower is not None and self.state in (State.MOVING, State.SLEEPING):
            arm.servo(follower.advance(dt))
            self.state = State.MOVING if follower.moving else State.SLEEPING
            self._watch(follower, positions, dt)
        elif self.mode == POSITION_MODE and self.state in (State.MOVING, State.SLEEPING):
            self.state = State.MOVING if self.commands_left else State.SLEEPING

    def _watch(self, follower: ServoFollower, positions: Array, dt: float) -> None:
        """Raise the errors of the controller: a jump of set-points, or a collision of an obstructed joint."""
        if follower.too_fast or (self.reduced and follower.faster_than(self.reduced_joint_speed)):
            self.trip(SPEED_ERROR)
        held_up = bool(np.any(np.abs(follower.setpoint - positions) > TRACKING_TOLERANCE))
        self._astray = self._astray + dt if held_up else 0.0
        if self._astray > TRACKING_TIME:
            self.trip(COLLISION_ERROR)

    def _take(self, goal: Array, arrived: float) -> None:
        if self._turned is not None:
            joint, middle = self._turned
            goal = goal.copy()
            goal[joint] = 2.0 * middle - goal[joint]
        if self._follower is None:
            self._follower = ServoFollower(self._arm.positions(), self._speed)
        self._follower.take(arrived, goal)

    def _halt(self) -> None:
        self._arm.stop()
        self._follower, self._motion, self._astray = None, None, 0.0

    def _ready(self) -> bool:
        return self.enabled and not self.error and self.state in (State.MOVING, State.SLEEPING)

    def _move_gripper(self, gripper: Gripper, share: float, pace: float) -> None:
        part, opened = gripper.model.part, gripper.model.max_width
        gripper.move(part.min_width + share * (opened - part.min_width), speed=pace * part.max_speed)

    def _block_gripper(self, gripper: Gripper) -> None:
        if gripper.state().moving:
            self.gripper_error = GRIPPER_OVERLOAD
        gripper.stop()

    def _pulses(self) -> int:
        if self._gripper is None:
            return 0
        closed, opened = self._gripper.model.part.min_width, self._gripper.model.max_width
        share = (self._gripper.width() - closed) / (opened - closed)
        return round(share * PULSES)
