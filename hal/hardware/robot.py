"""A real robot: several controllers, one clock, one stop over all of them, one watchdog."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from operator import methodcaller
from pathlib import Path
from types import MappingProxyType
from typing import cast

from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.api import Failure, MotionErrorCode, Part, Robot
from hal.hardware.clock import RealTimeClock
from hal.hardware.connection import Connection
from hal.hardware.control_loop import ControlLoop
from hal.hardware.controller_facts import ArmFacts, Identity
from hal.hardware.heartbeat import Heartbeat
from hal.hardware.stop_input import StopInput
from hal.parts.black_box import StopRecorder
from hal.parts.channels import traces
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch

WATCH_RATE = 100.0
"""Rate at which the watchdog checks each controller, hertz."""
PLANNER = "the program that plans"
"""Its name among faults."""
STOP_INPUT = "stop input"
"""Its name among faults."""
HELD_UP, HELD_UP_WITHIN = 0.05, 1.0
"""Delay of the watchdog, seconds, that shows that this process lacked processor time; and the seconds for which this
may explain a fault.
"""
FOUND_AGAIN_TIME = 1.0
"""Seconds within which a program that continues sends heartbeats again."""


class HardwareRobot(Robot):
    """The robot of a model's ``connections``, with their parts.

    A fault of any controller, except one that only has sensors, stops and latches all parts: motions of the faulty
    controller fail with its code and the vendor's, all others are cancelled as stopped. ``clear_stop()`` clears faults
    and reconnects lost controllers.

    ``world``, ``seed`` and ``gui`` are for simulated drivers and have no effect here. ``connections``: the controllers
    by name. ``stopped_at``: clock time of the last stop of all parts, seconds; kept by ``clear_stop()``; None: never.
    ``planner``: heartbeat of the commanding program in another process; the robot stops when it is silent.
    """

    clock: RealTimeClock

    def __init__(
        self,
        model: RobotModel,
        world: World | None = None,
        *,
        seed: int = 0,
        gui: bool = False,
        clock: RealTimeClock | None = None,
        planner: Heartbeat | None = None,
    ) -> None:
        self.model, self._planner = model, planner
        self.clock = clock or RealTimeClock()
        self._latch = StopLatch()
        self._lock = threading.RLock()
        self._faults: dict[str, Failure] = {}
        config = model.safety.stop_input
        self._stop_input = StopInput(config) if config is not None else None
        self._watchdog: ControlLoop | None = None
        self._watchdog_ended = False
        self._objection: str | None = None  # of the stop input, as of the watchdog's last look
        self.stopped_at: float | None = None
        self._held_up = 0.0, -HELD_UP_WITHIN  # seconds of the longest time lately, and when it ended
        self.connections = {name: self._make(name) for name in model.connections}
        parts: dict[str, Part] = {}
        for connection in self.connections.values():
            parts |= connection.parts
        self.parts = MappingProxyType({name: parts[name] for name in _in_order_of(model, parts)})
        self._recorder = StopRecorder(traces(self.parts, self.clock.now), self.clock.now, background=True)

    @property
    def unsupported(self) -> dict[str, str]:
        """Return the missing functions of its controllers and the parts without a controller → the reason."""
        missing = {name: "it is behind no connection" for name in self.model.parts if name not in self.parts}
        for name, connection in self.connections.items():
            for what, why in connection.unsupported.items():
                reason = f"{name}: {why}"
                missing[what] = f"{missing[what]}; {reason}" if what in missing else reason
        return missing

    def connect(self) -> None:
        """Connect all controllers, or none; idempotent. Raises ConnectionFailedError naming the failed one and the
        reason.
        """
        if self._watchdog is not None:
            return
        if not self.connections:
            raise ConnectionFailedError(f"robot {self.model.name!r} has no connections in its YAML")
        try:
            if self._stop_input is not None:
                self._stop_input.open()
            for connection in self.connections.values():
                connection.connect()
        except BaseException:
            self._disconnect_all()
            raise
        self._watchdog_ended = False
        self._watchdog = ControlLoop("watchdog", WATCH_RATE, self._watch, self._watchdog_crashed)
        self._watchdog.start()

    def disconnect(self) -> None:
        """End motions and periodic calls, disconnect all controllers, also after the error of one, which is raised at
        the end; idempotent.
        """
        if not self.connected:
            return
        if self._watchdog is not None:
            self._watchdog.close()
            self._watchdog = None
        with ExitStack() as rest:
            rest.callback(self.clock.cancel_timers)
            rest.callback(self._recorder.flush)
            self._disconnect_all()

    def stop(self, fault: Failure | None = None) -> None:
        """Bring all parts to rest and latch the stop, because of ``fault``; thread-safe, effective immediately."""
        self._stop(fault)

    def keep_black_box_in(self, folder: Path | None) -> None:
        """Set the folder of the black box; waits until the robot rests after a recent stop."""
        time.sleep(self._recorder.due_in)
        self._recorder.keep_in(folder)

    @property
    def connected(self) -> bool:
        """Return whether the robot is connected; also true while a controller could not be disconnected."""
        return self._watchdog is not None or any(one.connected for one in self.connections.values())

    @property
    def stops(self) -> int:
        """Return the number of stops so far."""
        return self._latch.stops

    def clear_stop(self, since: int | None = None) -> None:
        """Accept commands again; clears faults of controllers and reconnects lost ones.

        Raises ConnectionFailedError, with the robot still stopped, if that fails or if the robot was stopped again
        meanwhile; ``since``: number of stops to compare with, by default the current one. Controllers that only have
        sensors and cannot be reconnected stay among ``faults``.
        """
        with self._lock:
            stops = self._latch.stops if since is None else since
            lost = {}
            if self._watchdog is not None:
                self._await_planner()
                if self._objection is not None:
                    raise ConnectionFailedError(self._objection)
                lost = {
                    name: fault for name, connection in self.connections.items() if (fault := self._clear(connection))
                }
                if self._watchdog_ended:  # nothing may move without it
                    self._watchdog_ended = False
                    self._watchdog.close()
                    self._watchdog.start()
            self._faults.clear()
            self._faults.update(lost)
            self._latch.clear(stops)
            if self._latch:
                raise ConnectionFailedError("the robot was stopped again while its stop was cleared")

    @property
    def stopped(self) -> bool:
        """Return whether the stop is latched."""
        return bool(self._latch)

    @property
    def faults(self) -> Mapping[str, Failure]:
        """Controller → the fault that stopped the robot; empty after ``clear_stop()``."""
        return dict(self._faults)

    def diagnostics(self) -> dict[str, str]:
        """Return diagnostic texts by subject, without addresses."""
        texts = {
            "implementation": "hardware",
            "connected": "yes" if self.connected else "no",
            "stopped": (f"yes: {self._latch.fault}" if self._latch.fault else "yes") if self._latch else "no",
            "time": f"{self.clock.now():.2f} s",
        }
        for name, connection in self.connections.items():
            fault = self._faults.get(name)
            state = str(fault) if fault is not None else "well" if connection.connected else "not connected"
            texts[name] = f"{connection.driver}: {state}"
            if connection.remarks:
                texts[f"{name} remarks"] = "; ".join(connection.remarks)
            texts |= {loop.name: str(loop.lateness()) for loop in connection.loops}
        return texts

    def identities(self) -> dict[str, Identity]:
        """Return the identities of the connected controllers, by connection."""
        return {name: connection.identity() for name, connection in self.connections.items()}

    def arm_facts(self, arm: str) -> ArmFacts | None:
        """Return the state of an arm in its connected controller, or None if it is not reported."""
        return next(c for c in self.connections.values() if arm in c.parts).arm_facts()

    def _make(self, name: str) -> Connection:
        settings = self.model.connections[name]
        make = cast(Callable[..., Connection], CONNECTIONS.resolve(settings.driver))
        return make(name, settings, self.model, self.model.safety, self.clock, self._latch)

    def _clear(self, connection: Connection) -> Failure | None:
        """Clear the fault of a connection; return why one that stops nothing is still lost."""
        fault = self._faults.get(connection.name)
        try:
            connection.clear(fault)
        except ConnectionFailedError as error:
            if connection.stops_robot:
                raise
            return fault or Failure(MotionErrorCode.DISCONNECTED, str(error), connection.name)
        return None

    def _stop(self, fault: Failure | None, fail: Callable[[], None] = lambda: None) -> None:
        """Stop. ``fail``: the failure of motions. New commands are refused before a caller can see that a motion has
        ended.
        """
        first = self._latch.set(fault)
        fail()
        self._on_all(methodcaller("stop"))
        if first:
            self.stopped_at = self.clock.now()
            self._recorder.stopped("stop() was called" if fault is None else str(fault))

    def _await_planner(self) -> None:
        """Wait for the caller's heartbeats, which arrive shortly after its request."""
        deadline = time.monotonic() + FOUND_AGAIN_TIME
        while self._planner is not None and self._planner.silence > 0.0:
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{PLANNER} sends no heartbeat, which motion requires")
            time.sleep(0.005)

    def _watch(self, elapsed: float) -> None:
        """Stop the robot once, if a controller has a fault or the planning process sends no heartbeat."""
        self._recorder.look()
        now = self.clock.now()
        if elapsed > HELD_UP and (elapsed > self._held_up[0] or now > self._held_up[1] + HELD_UP_WITHIN):
            self._held_up = elapsed, now
        self._objection = None if self._stop_input is None else self._stop_input.look()
        if self._objection is not None and STOP_INPUT not in self._faults:
            self._faults[STOP_INPUT] = asked = Failure(MotionErrorCode.STOPPED, self._objection)
            self._stop(asked)
        if self._planner is not None and self._planner.silence > 0.0 and PLANNER not in self._faults:
            text = f"{PLANNER} sent no heartbeat for {self._planner.longest_silence:g} s"
            silent = Failure(MotionErrorCode.STOPPED, text)
            self._faults[PLANNER] = silent
            self._stop(silent)
        for name, connection in self.connections.items():
            if name in self._faults or not self._lock.acquire(blocking=False):
                continue
            try:
                fault = connection.fault()
                if fault is not None and name not in self._faults:
                    self._faults[name] = fault = self._of_whom(fault)
                    if connection.stops_robot:
                        self._stop(replace(fault, part=fault.part or name), partial(connection.fail, fault))
                    else:
                        connection.fail(fault)
            finally:
                self._lock.release()

    def _of_whom(self, fault: Failure) -> Failure:
        """Return the fault; silence and lateness also name a recent delay of this machine, if any."""
        lasted, ended = self._held_up
        if fault.code not in (MotionErrorCode.DISCONNECTED, MotionErrorCode.TIMEOUT):
            return fault
        if self.clock.now() > ended + HELD_UP_WITHIN:
            return fault
        text = f"{fault.text}, and this program was itself held up for {lasted:.2f} s: this machine may be too busy"
        return replace(fault, text=text)

    def _watchdog_crashed(self, error: Exception) -> None:
        self._watchdog_ended = True
        text = f"the watchdog stopped working: {type(error).__name__}: {error}"
        self._stop(Failure(MotionErrorCode.FAULT, text))

    def _disconnect_all(self) -> None:
        with ExitStack() as rest:
            if self._stop_input is not None:
                rest.callback(self._stop_input.close)
            self._on_all(methodcaller("disconnect"))

    def _on_all(self, do: Callable[[Connection], None]) -> None:
        """Call ``do`` with each connection, also after the error of one, which is raised at the end."""
        with ExitStack() as calls:
            for connection in reversed(self.connections.values()):
                calls.callback(do, connection)


def _in_order_of(model: RobotModel, parts: Mapping[str, Part]) -> list[str]:
    """Return names in the order of the robot's YAML kinds, so that the first arm of a list is the model's first arm."""
    known = [name for name in model.parts if name in parts]
    return [*known, *(name for name in parts if name not in known)]
