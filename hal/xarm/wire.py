"""The connection to one xArm controller: requests, time of the last reply, reported state."""

from __future__ import annotations

import contextlib
import io
import logging
import math
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any, TextIO

import numpy as np

from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel
from hal.api import Clock, Failure, MotionErrorCode
from hal.hardware.controller_facts import ArmFacts, Identity
from hal.parts.part_connection import ConnectionFailedError
from hal.xarm.options import ArmKind, XArmOptions

LITE6 = 9
"""The Lite 6's type in the controller's version."""
NARROWER_SINCE, UNTIL = 1305, 8500
"""Serial numbers of xArms whose limits the SDK lists under a separate type."""
ROUNDING = 0.01


@dataclass(frozen=True)
class ArmIdentity:
    """The arm in a controller's report: number of joints, type, and their limits from the SDK's table (radians), or
    none.
    """

    axes: int
    device_type: int
    limits: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, arm: Any, load: Callable[[str], ModuleType]) -> ArmIdentity:
        """Return the identity of the SDK's connected ``arm``; its limits are looked up as the SDK does."""
        serial = arm.sn[2:6] if arm.sn else ""
        narrower = serial.isdigit() and NARROWER_SINCE <= int(serial) < UNTIL
        listed_as = int(f"{arm.axis}{NARROWER_SINCE}") if narrower else arm.device_type
        table: Mapping[int, Mapping[int, Any]] = load("xarm.core.config.x_config").XCONF.Robot.JOINT_LIMITS
        limits = tuple((low, high) for low, high in table.get(arm.axis, {}).get(listed_as, ()))
        return cls(int(arm.axis), int(arm.device_type), limits)

    def mismatch(self, kind: ArmKind, model: ArmModel) -> str | None:
        """Return the difference from the arm of the robot file, or None."""
        if self.axes != len(model.joint_names):
            return f"the controller has {self.axes} joints, the robot file's arm has {len(model.joint_names)}"
        connected: ArmKind = "lite6" if self.device_type == LITE6 else "xarm"
        if connected != kind:
            return f"the controller moves an arm of the kind {connected!r}, the option 'arm' says {kind!r}"
        if not self.limits:  # a type that the SDK's table lacks
            return None
        for joint, (low, high), lower, upper in zip(
            model.joint_names, self.limits, model.lower, model.upper, strict=True
        ):
            if lower < low - ROUNDING or upper > high + ROUNDING:
                ranges = " to ".join(f"{math.degrees(end):.1f}°" for end in (low, high))
                asked = " to ".join(f"{math.degrees(end):.1f}°" for end in (lower, upper))
                return f"the controller's {joint} goes from {ranges}, the robot file's from {asked}: 'set' its limits"
        return None


class _SilentHere(io.TextIOBase):
    """A standard output that swallows what one thread writes and passes on what others do."""

    def __init__(self, original: TextIO) -> None:
        self._original, self._thread = original, threading.get_ident()

    def write(self, text: str) -> int:
        if threading.get_ident() == self._thread:
            return len(text)
        return self._original.write(text)

    def flush(self) -> None:
        self._original.flush()


@contextlib.contextmanager
def silenced_sdk() -> Iterator[None]:
    """Suppress the SDK's output, which contains the controller's address, and restore the timeout of sockets that it
    changes.
    """
    timeout = socket.getdefaulttimeout()
    try:
        with contextlib.redirect_stdout(_SilentHere(sys.stdout)):
            yield
    finally:
        socket.setdefaulttimeout(timeout)


def import_sdk(load: Callable[[str], ModuleType]) -> Any:
    """Return the package ``xarm``; its log, which contains the address, is limited to critical messages."""
    with silenced_sdk():
        package = load("xarm")
        log = load("xarm.core.utils.log")
    log.logger.setLevel(logging.CRITICAL)
    logging.getLogger("origin.print").setLevel(logging.CRITICAL)
    return package


COLLISION = frozenset({22, 31})
"""Self-collision, and the current that a collision caused: the controller's protective stop."""
TRACKING = frozenset({30, 38})
"""Feedback speed beyond its limit, abnormal joint angle."""
STOP_BUTTONS = frozenset({1, 2, 3})


def controller_fault(number: int, load: Callable[[str], ModuleType]) -> Failure:
    """Return the fault for error ``C<number>`` of the controller; its text is the vendor's."""
    if number in COLLISION:
        code = MotionErrorCode.COLLISION
    elif number in TRACKING:
        code = MotionErrorCode.TRACKING
    elif number in STOP_BUTTONS:
        code = MotionErrorCode.STOPPED
    else:
        code = MotionErrorCode.FAULT
    words = load("xarm.core.config.x_code").ControllerErrorCodeMap
    return Failure(code, _title(words, number), vendor_code=f"C{number}")


def gripper_fault(number: int, load: Callable[[str], ModuleType]) -> Failure:
    """Return the fault for error ``G<number>`` of the gripper."""
    words = load("xarm.core.config.x_code").GripperErrorCodeMap
    return Failure(MotionErrorCode.FAULT, _title(words, number), vendor_code=f"G{number}")


def _title(words: dict[object, dict[str, dict[str, str]]], number: int) -> str:
    return words.get(number, words["other"])["en"]["title"]


CONTROL_PORT = 502
GET_VERSION = struct.pack(">HHHB", 1, 2, 1, 1)
"""Transaction 1 of UFACTORY's private protocol (2), one byte: register 1."""


def answers(address: str, timeout: float) -> bool:
    """Return whether the control box at ``address`` reports its version within ``timeout`` s; the SDK would try for
    minutes.
    """
    try:
        with socket.create_connection((address, CONTROL_PORT), timeout) as wire:
            wire.settimeout(timeout)
            wire.sendall(GET_VERSION)
            return bool(wire.recv(64))
    except OSError:
        return False


REPORT_PORT, REPORT_LENGTH = 30001, 145
"""Port on which the control box reports the settings of its arm five times a second; bytes of such a report."""


def read_report(address: str, timeout: float) -> ArmFacts | None:
    """Return the settings of the arm in the control box, or None if no report arrives within ``timeout`` s.

    Its fields are those of the vendor's SDK (``__handle_report_normal``): little-endian floats, mm, radians and kg.
    """
    report = b""
    try:
        with socket.create_connection((address, REPORT_PORT), timeout) as wire:
            wire.settimeout(timeout)
            while len(report) < REPORT_LENGTH and (chunk := wire.recv(REPORT_LENGTH - len(report))):
                report += chunk
    except OSError:
        return None
    if len(report) < REPORT_LENGTH:
        return None
    positions, pose = struct.unpack_from("<7f", report, 7), struct.unpack_from("<6f", report, 35)
    offset, load = struct.unpack_from("<6f", report, 91), struct.unpack_from("<4f", report, 115)
    gravity = np.array(struct.unpack_from("<3f", report, 133))
    return ArmFacts(
        np.array(positions),
        Pose.from_xyz_rpy(1e-3 * np.array(pose[:3]), pose[3:]),
        Pose.from_xyz_rpy(1e-3 * np.array(offset[:3]), offset[3:]),
        payload=load[0],
        gravity=gravity,
    )


SERVO_MODE = 1
READY, STOPPED = 0, (4, 5)
ERROR_FLAGGED, WARNING_FLAGGED, STATE_NOT_READY = 1, 2, 9
NOT_CONNECTED = -1
UNANSWERED = frozenset({NOT_CONNECTED, 3, 8})
"""Codes of the SDK for: not connected, no reply in time, not sent. The watchdog handles the last two."""
GRIPPER_FAULT = 102
RECOVERY_TIME = 3.0
LOOK_FIRST = "inspect the robot, then run: bestman-bt robot release"
MODE_CHANGE_TIME = 0.1
"""Time that the controller takes to change its mode, seconds."""


class XArmWire:
    """Holds the SDK's object while connected; used by the loops of one connection."""

    def __init__(self, name: str, clock: Clock, load: Callable[[str], ModuleType]) -> None:
        self._name, self._clock, self._load = name, clock, load
        self._arm: Any = None
        self._heard = 0.0
        self._fault: Failure | None = None
        self._judging = threading.RLock()  # a reply from before a recovery says nothing about the time after it

    @property
    def heard(self) -> float:
        """Clock time of the last reply, seconds."""
        return self._heard

    @property
    def fault(self) -> Failure | None:
        """Return the last fault of the controller or its gripper."""
        return self._fault

    @property
    def stopped(self) -> bool:
        """Return whether set-points have no effect: an error of the arm, not of the gripper, or a closed connection."""
        fault = self._fault
        return fault is not None and not fault.vendor_code.startswith("G")

    def read_identity(self) -> Identity:
        """Return the serial number of the arm and the firmware of the control box."""
        arm = self._arm
        kind = "Lite" if arm.device_type == LITE6 else "xArm"
        serial_number = self.ask(lambda asked: asked.get_robot_sn())  # the version tells the beginning of it alone
        return Identity(f"{kind} {arm.axis}", serial_number or "", ".".join(map(str, arm.version_number)))

    @property
    def identity(self) -> ArmIdentity:
        """The arm type that the controller has reported."""
        return ArmIdentity.of(self._arm, self._load)

    def open(self, address: str, options: XArmOptions) -> None:
        """Connect. Raises ConnectionFailedError without a reply."""
        sdk = import_sdk(self._load)
        if not answers(address, options.connect_timeout):
            raise ConnectionFailedError(f"{self._name}: no xArm controller answers at its address")
        # No reports: each cycle reads, and the SDK's thread for reports polls a thousand times a second.
        arm = sdk.wrapper.XArmAPI(
            address,
            is_radian=True,
            do_not_open=True,
            enable_report=False,
            timed_comm=False,
            forbid_uds=True,
            check_cmdnum_limit=False,
        )
        self._arm = arm
        try:
            with silenced_sdk():
                arm.connect()
        except Exception as error:  # the SDK raises nothing narrower
            raise ConnectionFailedError(f"{self._name}: the xArm controller refuses the connection") from error
        if not arm.connected:
            raise ConnectionFailedError(f"{self._name}: the xArm controller does not report its version")
        arm.set_timeout(options.reply_timeout)
        self._heard, self._fault = self._clock.now(), None

    def close(self) -> None:
        """Leave servo mode as it is and close; idempotent."""
        arm, self._arm = self._arm, None
        if arm is not None:
            arm.disconnect()

    def ask(self, question: Callable[[Any], tuple[int, Any] | int]) -> Any:
        """Return the reply to a request, None without one."""
        if self._arm is None:
            return None
        reply = question(self._arm)
        code, answer = reply if isinstance(reply, tuple) else (reply, None)  # some faults come as a bare code
        self._note(code)
        return answer if code == 0 else None

    def send(self, what: str, command: Callable[[Any], int]) -> None:
        """Send a command; a refusal sets the controller's reported fault."""
        if self._arm is None:
            return
        code = command(self._arm)
        self._note(code)
        if code in UNANSWERED or code in (0, ERROR_FLAGGED, WARNING_FLAGGED, GRIPPER_FAULT):
            return
        if self._fault is None:
            text = "the controller is not ready to move" if code == STATE_NOT_READY else f"the SDK refused a {what}"
            self._fault = Failure(MotionErrorCode.FAULT, text, vendor_code=f"SDK {code}")

    def demand(self, what: str, command: Callable[[Any], int]) -> None:
        """Send a command that must succeed. Raises ConnectionFailedError otherwise."""
        code = command(self._arm)
        self._note(code)
        if code not in (0, WARNING_FLAGGED):
            reason = f": {self._fault}" if self._fault is not None else ""
            raise ConnectionFailedError(f"{self._name}: the controller refused {what} (SDK {code}){reason}")

    def make_ready(self, gripper: bool) -> None:
        """Enter servo mode.

        Raises ConnectionFailedError if the controller has an error, which a person must inspect.
        """
        with self._judging:
            self._fault = None
            self._arm.clean_warn()
            self._look_for_errors()
            if self._fault is not None:
                raise ConnectionFailedError(f"{self._name}: {self._fault}: {LOOK_FIRST}")
            self.demand("servo mode", lambda arm: arm.set_mode(SERVO_MODE))
            self.demand("the ready state", lambda arm: arm.set_state(READY))
            self._await_readiness()
            if gripper:
                self._arm.clean_gripper_error()
                self.demand("the gripper's position mode", lambda arm: arm.set_gripper_mode(0))
                self.demand("the gripper", lambda arm: arm.set_gripper_enable(True))
            self._heard, self._fault = self._clock.now(), None

    def held(self) -> str | None:
        """Return the controller's error, or that it is stopped, or None if neither applies."""
        self._fault = None
        self._look_for_errors()
        if self._fault is not None:
            return str(self._fault)
        return "its motors are off, or it is stopped" if self._arm.get_state()[1] in STOPPED else None

    def release(self) -> None:
        """Clear the error, switch the motors on, leave the stop."""
        self._arm.clean_error()
        self.demand("motion_enable", lambda arm: arm.motion_enable(True))
        self.demand("the ready state", lambda arm: arm.set_state(READY))

    def _await_readiness(self) -> None:
        time.sleep(MODE_CHANGE_TIME)
        deadline = time.monotonic() + RECOVERY_TIME
        while self._arm.get_state()[1] in STOPPED:
            self._look_for_errors()
            if self._fault is not None or time.monotonic() > deadline:
                why = str(self._fault) if self._fault is not None else "its motors are off, or it is stopped"
                raise ConnectionFailedError(f"{self._name}: the xArm does not become ready: {why}: {LOOK_FIRST}")
            time.sleep(0.02)

    def _note(self, code: int) -> None:
        """Update the controller's state from a reply."""
        if code == NOT_CONNECTED:
            text = f"the controller has closed the connection of {self._name}"
            self._fault = Failure(MotionErrorCode.DISCONNECTED, text)
        if code in UNANSWERED:
            return
        self._heard = self._clock.now()
        if code == GRIPPER_FAULT:
            with self._judging:
                _, number = self._arm.get_gripper_err_code()
                if number:
                    self._fault = gripper_fault(number, self._load)
        if self._arm.has_err_warn:
            self._look_for_errors()

    def _look_for_errors(self) -> None:
        with self._judging:
            code, (error, _) = self._arm.get_err_warn_code()
            if code == 0 and error:
                self._fault = controller_fault(error, self._load)
