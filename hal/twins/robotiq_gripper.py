"""A Robotiq 2F gripper as a state machine over a gripper of the twins' world."""

from __future__ import annotations

import numpy as np

from hal.api import Gripper, Motion, MotionStatus
from hal.twins.world import TwinWorld

OPEN, CLOSED = 3, 230
"""Its own numbers where the fingers are fully open and closed."""
LEAST_SPEED, LEAST_FORCE = 0.02, 20.0
ACTIVATION_TIME = 0.3
RESET, ACTIVATING, ACTIVE = 0, 1, 3
MOVING, HELD, ARRIVED = 0, 2, 3
NOT_ACTIVATED_FAULT, OVERCURRENT_FAULT = 7, 14


class RobotiqGripper:
    """Called by the protocol servers from their threads; touches the robot only in the world's thread (``tick``).

    ``variables``: what it tells, by the names of its URCap.
    """

    def __init__(self, world: TwinWorld, gripper: Gripper) -> None:
        self._world, self._gripper = world, gripper
        self._target, self._speed, self._force = OPEN, 255, 255
        self._wanted = {"ACT": 0, "GTO": 0}
        self._activation, self._fault, self._object = RESET, 0, ARRIVED
        self._active_in = 0.0
        self._jammed = False
        self._motion: Motion[None] | None = None
        self._position = OPEN
        world.ticks.append(self.tick)

    @property
    def variables(self) -> dict[str, int]:
        """What it tells now."""
        return {
            **self._wanted,
            "STA": self._activation,
            "OBJ": self._object,
            "FLT": self._fault,
            "PRE": self._target,
            "POS": self._position,
            "SPE": self._speed,
            "FOR": self._force,
        }

    def command(self, values: dict[str, int]) -> None:
        """New values of some of ACT, GTO, POS, SPE, FOR, taken together."""
        self._target = values.get("POS", self._target)
        self._speed, self._force = values.get("SPE", self._speed), values.get("FOR", self._force)
        before = dict(self._wanted)
        self._wanted |= {name: value for name, value in values.items() if name in self._wanted}
        if self._wanted["ACT"] != before["ACT"]:
            self._activate(bool(self._wanted["ACT"]))
        if self._activation != ACTIVE:
            if "POS" in values and self._wanted["GTO"] and not self._wanted["ACT"]:
                self._fault = NOT_ACTIVATED_FAULT
        elif self._wanted["GTO"] and ("POS" in values or not before["GTO"]):
            self._go()
        elif before["GTO"] and not self._wanted["GTO"]:
            self._world.post(self._gripper.stop)

    def jam(self) -> None:
        """The fingers are stuck where they are, until ``unjam``; its motor notices if it is moving them."""
        self._jammed = True
        if self._object == MOVING:
            self._fault = OVERCURRENT_FAULT
        self._world.post(self._gripper.stop)

    def unjam(self) -> None:
        """The fingers are free again; a fault stays until the next activation."""
        self._jammed = False

    def tick(self, dt: float) -> None:
        """One physics step of the world is about to come."""
        closed, opened = self._gripper.model.part.min_width, self._gripper.model.max_width
        share = (opened - self._gripper.width()) / (opened - closed)
        self._position = round(OPEN + float(np.clip(share, 0.0, 1.0)) * (CLOSED - OPEN))
        if self._activation == ACTIVATING:
            self._active_in -= dt
            if self._active_in <= 0.0:
                self._activation = ACTIVE
        if self._motion is not None and self._motion.done:
            arrived = self._motion.status is MotionStatus.SUCCEEDED and self._gripper.state().at_target
            self._object = ARRIVED if arrived else HELD
            self._motion = None

    def _activate(self, on: bool) -> None:
        self._fault, self._object = 0, ARRIVED
        self._activation, self._active_in = (ACTIVATING, ACTIVATION_TIME) if on else (RESET, 0.0)
        if not on:
            self._wanted["GTO"] = 0
            self._world.post(self._gripper.stop)

    def _go(self) -> None:
        if self._jammed:
            self._fault = OVERCURRENT_FAULT
            return
        part, opened = self._gripper.model.part, self._gripper.model.max_width
        share = float(np.clip((self._target - OPEN) / (CLOSED - OPEN), 0.0, 1.0))
        width = opened - share * (opened - part.min_width)
        speed = LEAST_SPEED + self._speed / 255.0 * (part.max_speed - LEAST_SPEED)
        force = LEAST_FORCE + self._force / 255.0 * (part.max_force - LEAST_FORCE)
        self._object = MOVING

        def begin() -> None:
            self._motion = self._gripper.move(width, force, speed)

        self._world.post(begin)
