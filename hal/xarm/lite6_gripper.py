"""The gripper of a Lite 6: two tool outputs open and close it, without feedback."""

from __future__ import annotations

import numpy as np

from bestman_bt.robot_model.model import GripperModel
from hal.api import Clock, GripperState, Motion
from hal.parts.channels import GripperChannel, GripperReading
from hal.parts.gripper import CommandedGripper
from hal.xarm.wire import XArmWire

AT_END = 1e-6


class Lite6GripperWire(GripperChannel):
    """A gripper that only opens or closes fully. Its width is estimated from the time since the last command."""

    def __init__(self, wire: XArmWire, model: GripperModel, clock: Clock) -> None:
        self._wire, self._model, self._clock = wire, model, clock
        self._from = self._to = model.part.min_width
        self._since = 0.0

    def recall(self) -> None:
        """Restore the state from its last outputs; if unknown, the gripper counts as closed."""
        outputs = self._wire.ask(lambda arm: arm.get_tgpio_output_digital())
        opened = outputs is not None and bool(outputs[0])
        self._from = self._to = self._model.max_width if opened else self._model.part.min_width

    def read(self) -> GripperReading:
        """Return an estimate: the fingers move at the part's ``max_speed`` until they reach their target."""
        moved = self._model.part.max_speed * (self._clock.now() - self._since)
        return GripperReading(self._from + float(np.clip(self._to - self._from, -moved, moved)))

    def send(self, width: float, force: float, speed: float) -> None:
        """Open or close; the gripper's force and speed are fixed."""
        opens = width >= self._model.max_width - AT_END
        self._begin(self._model.max_width if opens else self._model.part.min_width)
        if opens:
            self._wire.send("gripper", lambda arm: arm.open_lite6_gripper(sync=False))
        else:
            self._wire.send("gripper", lambda arm: arm.close_lite6_gripper(sync=False))

    def halt(self) -> None:
        """Cut the gripper's power; it may drop a held object."""
        self._begin(self.read().width)
        self._wire.send("gripper", lambda arm: arm.stop_lite6_gripper(sync=False))

    def _begin(self, goal: float) -> None:
        self._from, self._to, self._since = self.read().width, goal, self._clock.now()


class Lite6Gripper(CommandedGripper):
    """A gripper without intermediate widths and without detection of objects."""

    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion[None]:
        """Open or close fully. Raises CommandRefusedError for widths in between."""
        model = self.model
        if model.part.min_width + AT_END < width < model.max_width - AT_END:
            why = f"width = {width} m: a Lite 6's gripper opens ({model.max_width:.4g} m) and closes, nothing between"
            raise self._connection.refuse("move", why)
        return super().move(width, force, speed)

    def state(self) -> GripperState:
        """Return the state; ``object_held`` and ``empty`` are always False."""
        state = super().state()
        return GripperState(state.moving, state.at_target, object_held=False, empty=False)
