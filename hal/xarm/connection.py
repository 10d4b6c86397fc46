"""xArm 6, xArm 7 and Lite 6 with the xArm gripper, through the vendor's Python SDK."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.robot_model.model import ArmModel, GripperModel
from bestman_bt.robot_model.payload import Payload, arm_payload
from hal.api import Failure, NoDataError
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.controller_facts import ArmFacts, Identity
from hal.parts.channels import GripperChannel, GripperReading, JointChannel, JointReading
from hal.parts.gate import ToolLimits
from hal.parts.gripper import CommandedGripper
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.streamed_arm import StreamedArm
from hal.xarm.lite6_gripper import Lite6Gripper, Lite6GripperWire
from hal.xarm.options import XArmOptions
from hal.xarm.wire import XArmWire, read_report

Array = NDArray[np.float64]
LONGEST_STEP = 0.01
"""Largest tool motion between two set-points in servo mode, metres, by UFACTORY's guide."""
Result = TypeVar("Result")
FASTEST, SLOWEST = 5000, 350
"""Speeds of the gripper's motor, revolutions per minute; the fastest corresponds to the part's ``max_speed``."""


class XArmJoints(JointChannel):
    """Set-points in the controller's servo mode; readings come with the connection's cycle."""

    def __init__(self, wire: XArmWire, joints: int) -> None:
        self.longest_tool_step = LONGEST_STEP
        self._wire, self._count = wire, joints
        self._reading: JointReading | None = None

    def read(self) -> JointReading:
        """Return the reading of the last cycle."""
        if self._reading is None:
            raise NoDataError("the xArm has not reported joint positions yet")
        return self._reading

    def refresh(self) -> None:
        """Read positions, velocities and torques in one round trip; without a reply the last reading stays valid."""
        states = self._wire.ask(lambda arm: arm.get_joint_states(is_radian=True, num=3))
        if states is not None:
            columns = np.array(states, dtype=float)[:, : self._count]
            self._reading = JointReading(*columns)

    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point, radians, in one round trip."""
        self._wire.send("set-point", lambda arm: arm.set_servo_angle_j(positions.tolist(), is_radian=True))


class XArmGripper(GripperChannel):
    """The gripper on the arm's tool bus; its force is fixed."""

    def __init__(self, wire: XArmWire, model: GripperModel, pulses: int) -> None:
        self._wire, self._model = wire, model
        self._pulses_per_metre = pulses / (model.max_width - model.part.min_width)
        self._width: float | None = None

    def refresh(self) -> bool:
        """Read the width; without a reply the last one stays valid."""
        pulses = self._wire.ask(lambda arm: arm.get_gripper_position())
        if pulses is None:
            return False
        self._width = self._model.part.min_width + float(pulses) / self._pulses_per_metre
        return True

    def read(self) -> GripperReading:
        """Return the latest width."""
        if self._width is None:
            raise NoDataError("the xArm's gripper has reported no position yet")
        return GripperReading(self._width)

    def send(self, width: float, force: float, speed: float) -> None:
        """Send a target width."""
        pulses = round((width - self._model.part.min_width) * self._pulses_per_metre)
        share = speed / self._model.part.max_speed
        turns = int(np.clip(FASTEST * share, SLOWEST, FASTEST))
        self._wire.send("gripper", lambda arm: _set_position(arm, pulses, turns))

    def halt(self) -> None:
        """Make the current width the target; it is held with the gripper's fixed force."""
        self.refresh()
        self.send(self.read().width, 0.0, self._model.part.max_speed)


def _set_position(arm: Any, pulses: int, turns: int) -> int:
    """Set a position without waiting for the arm to stand still, as the SDK would; the next reading shows errors."""
    code: int = arm.set_gripper_position(pulses, speed=turns, wait=False, wait_motion=False, check_err=False)
    return code


REPORTS, REPORT_PERIOD = 3, 0.1
"""Number of reports to wait for, of which five arrive per second; seconds between two checks."""
COUNTS = "the controller counts on"
"""Beginning of a remark on a payload that differs."""
PAYLOAD_STEP = 0.01
"""Tolerance of a payload that is read back, kg: it is transferred in single precision."""
BLIND = "a Lite 6's gripper has no encoder: it reports no intermediate widths, nor whether it holds an object"


class XArmConnection(Connection):
    """An arm, and possibly a gripper, behind one controller.

    All motions are set-points in the controller's servo mode at ``rate`` Hz, each followed by a reading. If the client
    disappears, no more set-points arrive and the arm stays at the last one.
    """

    driver: ClassVar[str] = "xarm"
    package: ClassVar[str] = "xarm"
    extra: ClassVar[str] = "xarm"
    options_type: ClassVar[type] = XArmOptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {"arm": (1, 1), "gripper": (0, 1)}
    one_client: ClassVar[bool] = True
    unsupported: Mapping[str, str] = {
        "command(efforts=…)": "the controller takes no joint torques",
        "gripper force": "the force of this gripper cannot be set",
    }

    def factories(self) -> Mapping[str, PartFactory]:
        """Return the factories of the arm and of the gripper."""
        self._wire = XArmWire(self.name, self.clock, self.sdk)
        self._gripper: CommandedGripper | None = None
        self._lite6_gripper: Lite6GripperWire | None = None
        return {"arm": self._make_arm, "gripper": self._make_gripper}

    def _make_arm(self, name: str, model: ArmModel) -> StreamedArm:
        self._joints = XArmJoints(self._wire, len(model.joint_names))
        tool, period = ToolLimits(self.model, name, self.limits), 1.0 / self.options.rate
        self._arm = StreamedArm(name, model, self._joints, self.latch, period, tool)
        self._arm.send_load = self._set_load
        return self._arm

    def _make_gripper(self, name: str, model: GripperModel) -> CommandedGripper:
        if self.options.arm == "lite6":
            self.unsupported = {**self.unsupported, "a gripper opens and closes": BLIND}
            self._lite6_gripper = Lite6GripperWire(self._wire, model, self.clock)
            self._gripper = Lite6Gripper(name, model, self._lite6_gripper, self.latch)
        else:
            channel = XArmGripper(self._wire, model, self.options.gripper_pulses)
            self._gripper = CommandedGripper(name, model, channel, self.latch)
        return self._gripper

    @property
    def _speaks_to_gripper(self) -> bool:
        """Whether a gripper on the tool's bus has to be made ready."""
        return self._gripper is not None and self._lite6_gripper is None

    def open(self) -> None:
        """Connect and enter servo mode."""
        options: XArmOptions = self.options
        wire = self._wire
        wire.open(self.settings.address, options)
        mismatch = wire.identity.mismatch(options.arm, self.model.of(ArmModel)[self._arm.name])
        if mismatch is not None:
            raise ConnectionFailedError(f"{self.name}: {mismatch}")
        wire.make_ready(gripper=self._speaks_to_gripper)
        if self._lite6_gripper is not None:
            self._lite6_gripper.recall()
        self._set_limits(options)
        self._joints.refresh()
        self.add_loop("set-points", options.rate, self._cycle)
        if self._gripper is not None:
            self.add_loop("gripper", options.gripper_rate, self._gripper.cycle)

    @override
    def close(self) -> None:
        self._wire.close()

    def heard(self) -> float:
        """Return the time of the controller's last reply."""
        return self._wire.heard

    def reported_fault(self) -> Failure | None:
        """Return the error of the controller or of the gripper."""
        return self._wire.fault

    def identity(self) -> Identity:
        """Return the identity from the SDK."""
        return self._wire.read_identity()

    def arm_facts(self) -> ArmFacts | None:
        """Return the facts from the control box's report; joint ranges are those that the SDK lists for its type."""
        reported = read_report(self.settings.address, self.options.connect_timeout)
        if reported is None:
            return None
        limits = np.array(self._wire.identity.limits)
        axes = len(self._arm.joint_names)
        return replace(reported, positions=reported.positions[:axes], joint_limits=limits if len(limits) else None)

    def recover(self) -> None:
        """Enter servo mode again."""
        self._wire.make_ready(gripper=self._speaks_to_gripper)
        self._joints.refresh()

    def held(self) -> str | None:
        """Return the controller's error, or that it is stopped."""
        return self._by_another_wire(XArmWire.held)

    def release(self) -> None:
        """Clear the controller's error and switch the motors on."""
        self._by_another_wire(XArmWire.release)

    def _by_another_wire(self, act: Callable[[XArmWire], Result]) -> Result:
        wire = XArmWire(self.name, self.clock, self.sdk)
        try:
            wire.open(self.settings.address, self.options)
            return act(wire)
        finally:
            wire.close()

    def _cycle(self, elapsed: float) -> None:
        self._joints.refresh()
        if self._wire.stopped:
            self._arm.give_way()
        else:
            self._arm.cycle(elapsed)

    def _set_load(self, mass: float, centre: ArrayLike) -> None:
        options: XArmOptions = self.options
        hand = None if options.payload is None else Payload(options.payload, np.array(options.payload_center))
        whole = arm_payload(self.model, self._arm.name, mass, centre, hand)
        millimetres = (1e3 * whole.centre).tolist()
        self._wire.send("payload", lambda arm: arm.set_tcp_load(whole.mass, millimetres, wait=False))
        words = self._other_payload(whole.mass)
        others = tuple(remark for remark in self.remarks if not remark.startswith(COUNTS))
        self.remarks = (*others, words) if words else others

    def _other_payload(self, mass: float) -> str:
        """Return the controller's payload if it differs from ``mass``; empty if it does not, or is not reported."""
        for _ in range(REPORTS):
            reported = read_report(self.settings.address, self.options.connect_timeout)
            counted = None if reported is None else reported.payload
            if counted is None or abs(counted - mass) <= PAYLOAD_STEP:
                return ""
            time.sleep(REPORT_PERIOD)
        return f"{COUNTS} {counted:.2f} kg at the flange, although it was set to {mass:.2f} kg"

    def _set_limits(self, options: XArmOptions) -> None:
        """Set the limits that the controller enforces, besides those that are enforced above it."""
        wire = self._wire
        sensitivity, payload = options.collision_sensitivity, options.payload
        if sensitivity is not None:
            wire.demand("the collision sensitivity", lambda arm: arm.set_collision_sensitivity(sensitivity, wait=False))
        if payload is not None:
            center = [1e3 * value for value in options.payload_center]
            wire.demand("the payload", lambda arm: arm.set_tcp_load(payload, center, wait=False))
            if words := self._other_payload(payload):
                raise ConnectionFailedError(f"{self.name}: {words}")
        if options.reduced_mode:
            joint_speed = float(np.max(self._arm.model.velocity))
            wire.demand("a joint speed", lambda arm: arm.set_reduced_max_joint_speed(joint_speed, is_radian=True))
            if self.limits.tool_speed is not None:
                tool_speed = 1e3 * self.limits.tool_speed
                wire.demand("a tool speed", lambda arm: arm.set_reduced_max_tcp_speed(tool_speed))
        wire.demand("reduced mode", lambda arm: arm.set_reduced_mode(options.reduced_mode))
