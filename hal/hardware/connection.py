"""The connection to one controller of a real robot; vendors' subclasses define only the protocol."""

from __future__ import annotations

import fcntl
import hashlib
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, TypeAlias

from bestman_bt.extras import install_command
from bestman_bt.robot_model.connection_config import ConnectionConfig, SafetyConfig
from bestman_bt.robot_model.hardware_config import control_kind
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.runtime_folder import runtime_folder
from hal.api import Bumper, Clock, Failure, ForceTorque, MotionErrorCode, Part, Sensor, Tactile
from hal.hardware.control_loop import ControlLoop
from hal.hardware.controller_facts import COMPARISONS, ArmFacts, Identity
from hal.parts.channels import ControlledPart
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch

PATIENCE = 3.0
"""Seconds that a new client waits, because the robot process of a killed program first brings the robot to rest."""


class ControllerLock:
    """The exclusive lock of one controller, held from ``take`` to ``release`` or to the end of the process.

    A file lock (flock) in the user's runtime folder, which the kernel releases when the process ends. The file is named
    by a digest, so that it does not reveal the address, and contains the process id.
    """

    def __init__(self, name: str, driver: str, address: str) -> None:
        self._name = name
        self._file = hashlib.sha256(f"{driver} {address.strip().lower()}".encode()).hexdigest()[:24] + ".lock"
        self._descriptor: int | None = None

    def take(self) -> None:
        """Acquire the exclusive lock of the controller; idempotent. Raises ConnectionFailedError naming the holder."""
        if self._descriptor is not None:
            return
        try:
            descriptor = os.open(runtime_folder() / self._file, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError as error:
            raise ConnectionFailedError(
                f"{self._name}: the lock against a second client cannot be acquired: {error.strerror or error}"
            ) from error
        deadline = time.monotonic() + PATIENCE
        while not _locked(descriptor):
            if time.monotonic() > deadline:
                holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip()
                os.close(descriptor)
                who = f"process {holder}" if holder else "another program"
                raise ConnectionFailedError(
                    f"{self._name}: {who} on this machine is connected to its controller already; "
                    "it could not distinguish the two and would follow both"
                )
            time.sleep(0.05)
        with suppress(OSError):  # the number is for people; the lock is what counts
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, str(os.getpid()).encode(), 0)
        self._descriptor = descriptor

    def release(self) -> None:
        """Release the lock; idempotent."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def _locked(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


LONGEST_BRAKING = 0.6
"""Seconds for parts to come to rest before their connection is closed."""


PartFactory: TypeAlias = Callable[[str, Any], Part]
"""Creates a part from its name and its model in ``RobotModel.parts``."""


class Connection(ABC):
    """A controller with its parts. The constructor does no work; ``parts`` can be read before ``connect()``.

    A vendor's subclass defines how to open and close the connection, when the controller last replied, and which fault
    it reports. Its ``factories`` make the parts from the classes in ``hal.parts`` and ``hal.hardware``, over its own
    channels; its control loops drive them. Limits, the stop, the command timeout and the watchdog are implemented above
    it.

    ``options_type``: frozen dataclass of the ``options`` in the robot's YAML. ``package``: import name of the SDK;
    ``extra``: our extra that installs it. ``serves``: kind of part → allowed numbers behind one controller; empty: any
    parts. ``needs_address``: whether an address is required. All these are checked when a robot is read, before
    anything connects. ``one_client``: whether the controller obeys any client, so that a second client must be refused
    here. ``unsupported``: features of the Robotics API that the controller lacks, or conformance checks that it cannot
    pass → reason; conformance lists them.
    """

    driver: ClassVar[str]
    options_type: ClassVar[type]
    package: ClassVar[str] = ""
    extra: ClassVar[str] = ""
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {}
    needs_address: ClassVar[bool] = True
    one_client: ClassVar[bool] = False
    unsupported: Mapping[str, str] = {}

    def __init__(
        self,
        name: str,
        settings: ConnectionConfig,
        model: RobotModel,
        limits: SafetyConfig,
        clock: Clock,
        latch: StopLatch,
    ) -> None:
        self.name, self.settings, self.model, self.limits = name, settings, model, limits
        self.clock, self.latch, self.options = clock, latch, settings.options
        self._loops: list[ControlLoop] = []
        self._crash: Failure | None = None
        self.remarks: tuple[str, ...] = ()  # what people should know of it, though it works
        self._unlike: tuple[str, ...] | None = None  # what the first connection found of the arm
        self.connected = False
        self._only = ControllerLock(name, self.driver, settings.address) if self.one_client else None
        factories = self.factories()
        self.parts = {
            part: factories[control_kind(model.kind(part))](part, model.parts[part]) for part in settings.parts
        }

    @property
    def stops_robot(self) -> bool:
        """Return whether a fault of this controller stops the robot; that of sensors, except contact sensors, only
        fails their users.
        """
        contacts = (Bumper, ForceTorque, Tactile)
        return any(not isinstance(part, Sensor) or isinstance(part, contacts) for part in self.parts.values())

    @property
    def longest_silence(self) -> float:
        """Seconds without a heartbeat or message after which the controller counts as lost."""
        return self.limits.watchdog

    @property
    def loops(self) -> tuple[ControlLoop, ...]:
        """The control loops, for their lateness."""
        return tuple(self._loops)

    @abstractmethod
    def factories(self) -> Mapping[str, PartFactory]:
        """Return kind of part → factory; called once, from the constructor. No work, no imports of SDKs."""

    @abstractmethod
    def open(self) -> None:
        """Open the connection and make the controller ready. Raises ConnectionFailedError if that fails.

        On return, the first readings have arrived. Create control loops here with ``add_loop``.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the connection; idempotent, also during ``open()``. Raises nothing."""

    @abstractmethod
    def heard(self) -> float:
        """Return the clock time of the controller's last heartbeat, seconds."""

    @abstractmethod
    def reported_fault(self) -> Failure | None:
        """Return the fault that the controller reports now; does not wait."""

    @abstractmethod
    def recover(self) -> None:
        """Clear a fault of the controller so that it can be commanded again.

        Raises ConnectionFailedError if it cannot.
        """

    def held(self) -> str | None:
        """Return, as text, the inspection required before the controller accepts commands, or None if it is released.
        Uses a separate connection, so that it works without an open one and while another process is connected.
        Collisions, safety violations and missing power require a person: ``open`` and ``recover`` then fail.
        """
        return None

    def release(self) -> None:  # noqa: B027 - for controllers that people have to release
        """Release the controller after an inspection. Raises ConnectionFailedError if it must be released at the
        robot."""

    def identity(self) -> Identity:
        """Return the identity of the connected controller."""
        return Identity()

    def arm_facts(self) -> ArmFacts | None:
        """Return the controller's knowledge of its arm, or None without an arm or a report; needs a connection."""
        return None

    def abandon(self) -> None:  # noqa: B027 - for wires that need it
        """Drop a lost connection immediately, so that its pending commands, or the SDK's, have no effect after a
        reconnection."""

    def connect(self) -> None:
        """Open the connection and start the loops; idempotent. Raises ConnectionFailedError, with everything closed."""
        if self.connected:
            return
        self._crash, self.remarks = None, ()
        if self._only is not None:
            self._only.take()
        try:
            self.open()
            self._check_serial_number()
            self._compare_arm()
            for part in self._moving():
                part.attach()
        except BaseException:
            for part in self._moving():
                part.detach()
            self._shut()
            raise
        for loop in self._loops:
            loop.start()
        self.connected = True

    def disconnect(self) -> None:
        """End motions, bring all reachable parts to rest, end the loops, close the connection; idempotent."""
        reachable = self.connected and self.fault() is None
        for part in self._moving():
            part.detach()
        deadline = time.monotonic() + LONGEST_BRAKING
        while reachable and time.monotonic() < deadline and not all(part.resting for part in self._moving()):
            time.sleep(0.005)
        self._shut()
        self.connected = False

    def stop(self) -> None:
        """Stop all parts immediately; thread-safe."""
        for part in self.parts.values():
            part.stop()

    def fault(self) -> Failure | None:
        """Return the fault that currently blocks the controller, or None."""
        if not self.connected:
            return None
        if self._crash is not None:
            return self._crash
        reported = self.reported_fault()
        if reported is not None:
            return reported
        silence = self.clock.now() - self.heard()
        if silence > self.longest_silence:
            text = f"no message from {self.name} for {silence:.2f} s"
            return Failure(MotionErrorCode.DISCONNECTED, text)
        return None

    def fail(self, fault: Failure) -> None:
        """End the motions of its parts as failed, and bring the reachable parts to rest."""
        for part in self._moving():
            part.fail(fault)
        if fault.code is MotionErrorCode.DISCONNECTED:
            self.abandon()

    def clear(self, noted: Failure | None) -> None:
        """Clear the controller's faults after a stop because of ``noted``, or reconnect if the connection was lost.

        A connection that was interrupted is reopened even if it works again, because the controller's state may have
        changed.
        """
        if not self.connected:
            self.connect()
            return
        faults = [fault for fault in (noted, self.fault()) if fault is not None]
        if not faults:
            return
        if self._crash is not None or any(fault.code is MotionErrorCode.DISCONNECTED for fault in faults):
            self.disconnect()
            self.connect()
        else:
            self.recover()
            for part in self._moving():
                part.attach()

    def add_loop(self, name: str, rate: float, step: Callable[[float], None]) -> None:
        """Add a loop that calls ``step`` at ``rate`` Hz while connected."""
        self._loops.append(ControlLoop(f"{self.name} {name}", rate, step, self._crashed))

    def sdk(self, module: str) -> ModuleType:
        """Return the vendor's SDK. Raises ConnectionFailedError naming the extra that installs it."""
        try:
            return import_module(module)
        except ImportError as error:
            raise ConnectionFailedError(
                f"{self.name} needs the package {module.partition('.')[0]!r}: {install_command(self.extra)}"
            ) from error

    def _check_serial_number(self) -> None:
        owed = self.model.serial_numbers.get(self.name, "")
        if owed and (actual := self.identity().serial_number) != owed:
            raise ConnectionFailedError(
                f"{self.name}: the controller's serial number is {actual or 'not reported'}, that of the bring-up is "
                f"{owed} ({self.model.bringup}): bring this robot up (bestman-bt robot bringup {self.model.name})"
            )

    def _compare_arm(self) -> None:
        """Compare tool, payload and mounting with the robot's file: a difference is refused if the signed bring-up has
        measured this value, else only reported.

        At the first connection only: later the hand may hold an object.
        """
        actual = self.arm_facts() if self._unlike is None else None
        if actual is not None:
            arm = next(name for name in self.parts if name in self.model.of(ArmModel))
            found = {step: compare(self.model, arm, actual) for step, compare in COMPARISONS.items()}
            unlike = {step: f"{arm}: {one.text}" for step, one in found.items() if one is not None and not one.agrees}
            if changed := [text for step, text in unlike.items() if arm in self.model.measured.get(step, ())]:
                why = "this differs from the robot's bring-up"
                raise ConnectionFailedError(f"{self.name}: {'; '.join(changed)} ({why}: {self.model.bringup})")
            self._unlike = tuple(unlike.values())
        self.remarks += self._unlike or ()

    def _crashed(self, error: Exception) -> None:
        self._crash = Failure(MotionErrorCode.FAULT, f"{self.name} stopped working: {type(error).__name__}: {error}")

    def _moving(self) -> list[ControlledPart]:
        return [part for part in self.parts.values() if isinstance(part, ControlledPart)]

    def _shut(self) -> None:
        for loop in self._loops:
            loop.close()
        self._loops.clear()
        self.close()
        if self._only is not None:
            self._only.release()
