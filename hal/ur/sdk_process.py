"""The vendor's SDK, unmodified, in a separate process: run as a script, without imports from this package.

Two threads of ur-rtde act on their own: if a connection fails, they reconnect and restart their program on the
controller, wait without a limit, and write to standard output. In a process that can be ended at any time this does no
harm: it ends with its parent, and the controller's own watchdog stops any remaining motion. Two pipes lead to the
parent. ``calls`` receives ``(name, arguments)`` and answers with ``(True, result)`` or ``(False, message)``. ``stream``
receives set-points, of which only the latest is used, and heartbeats (None), and sends ``Report``s. If the parent is
silent for ``heartbeat`` seconds, the arm brakes until ``recover``; likewise if this process was delayed and the next
set-point is more than ``longest_step`` radians from the last one.
"""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from bestman_bt.errors import Error

CONTROL_RATE = 125.0
"""Rate at which the SDK's control interface receives the state of its program, Hz."""
KICK_PERIOD = 0.02
SPEED_TIME = 0.02
"""Seconds that one ``speedj`` of the SDK's program lasts, after which it checks for a newer one."""
REST_TIME, AT_REST = 1.0, 0.02
"""Seconds for the arm to come to rest, and the joint speed that counts as rest, rad/s."""
REAL_TIME_PRIORITY = 20
DASHBOARD_TIME, PROGRAM_TIME = 2.0, 5.0
"""Seconds for a reply of the dashboard server, and for the controller to report that its program runs."""
READY_TIME = 5 * DASHBOARD_TIME + 2 * PROGRAM_TIME + 5.0
"""Longest duration of ``open`` and ``recover`` according to all of their own limits, with a reserve, seconds."""
RUNNING, PLAYING = 7, 2
VARIABLES = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "target_moment",
    "actual_TCP_pose",
    "ft_raw_wrench",
    "actual_digital_input_bits",
    "actual_digital_output_bits",
    "robot_mode",
    "safety_mode",
    "runtime_state",
    "speed_scaling",
    "target_speed_fraction",
    "payload",
]
PROGRAM = (Path(__file__).parent / "control.script").read_text(encoding="ascii")
PATH_PLACE = "    # inject move path\n"
OLDEST = (5, 6)
"""Minimum version of PolyScope: since then the dashboard server reports whether remote control is on."""
LOOK_FIRST = "inspect the robot, then run: bestman-bt robot release"


class Report(NamedTuple):
    """A report of the controller. ``time``: arrival, monotonic clock; ``stamp``: the controller's clock; seconds.

    Positions, velocities and the target torques of the controller's model: (6,) each; rad, rad/s, N m. ``tool_pose``:
    metres and rotation vector in the controller's base frame. ``wrench``: (6,) of the flange's sensor, N and N m.
    ``busy``: its program is being exchanged. ``moving``: the controller moves the arm along an uploaded path.
    ``lapsed``: why this process has braked the arm; empty: it has not. ``scaling``: time scale of motions by the speed
    slider and its limiter.
    """

    time: float
    stamp: float
    positions: list[float]
    velocities: list[float]
    torques: list[float]
    tool_pose: list[float]
    wrench: list[float]
    digital_inputs: int
    digital_outputs: int
    robot_mode: int
    safety_mode: int
    runtime_state: int
    busy: bool
    moving: bool
    lapsed: str = ""
    scaling: float = 1.0


class RefusedError(Error):
    """The controller is not in a state to be commanded."""


class SDKProcess:
    """Serves one parent process until it ends."""

    def __init__(self, calls: Connection, stream: Connection) -> None:
        self._calls, self._stream = calls, stream
        self._dashboard: Any = None
        self._receive: Any = None
        self._control: Any = None
        self._io: Any = None
        self._address = ""
        self._settings: dict[str, float] = {}
        self._busy = False
        self._kicked = 0.0
        self._program = os.memfd_create("control.script")
        self._heard: float | None = None  # of the parent; None: it has not begun to give signs of life
        self._lapsed = ""
        self._followed: list[float] | None = None  # the last set-point; None: the next one begins a stream
        self._followed_at = 0.0
        self._renewed_until: float | None = None  # None: the controller moves along nothing of its own
        self._stop: Callable[[], None] = self.stop_speed
        self._answers: dict[str, Callable[..., Any]] = {
            "open": self.open,
            "recover": self.recover,
            "leave": self.leave,
            "identity": self.identity,
            "set_payload": lambda mass, centre: self._control.setPayload(mass, centre),
            "firmware": lambda: self._dashboard.polyscopeVersion(),
            "arm": self.arm,
            "set_output": self.set_output,
            "upload_path": self.upload_path,
            "start_path": self.start_path,
            "end_path": self.end_path,
            "speed_joints": lambda speeds, acceleration: self.speed("speedJ", speeds, acceleration),
            "speed_tool": lambda twist, acceleration: self.speed("speedL", twist, acceleration),
            "renew": self.renew,
            "stop_path": self.stop_path,
            "stop_speed": self.stop_speed,
        }

    def serve(self) -> None:
        """Serve until the parent closes its ends, or dies."""
        selector = selectors.DefaultSelector()
        selector.register(self._calls, selectors.EVENT_READ)
        selector.register(self._stream, selectors.EVENT_READ)
        try:
            while True:
                ready = {key.fileobj for key, _ in selector.select(KICK_PERIOD / 2)}
                if self._stream in ready:
                    self._follow()
                if self._calls in ready:
                    self._answer(*self._calls.recv())
                if self._control is not None and time.monotonic() - self._kicked > KICK_PERIOD:
                    self._control.kickWatchdog()
                    self._kicked = time.monotonic()
                if self._heard is not None and time.monotonic() - self._heard > self._settings["heartbeat"]:
                    self._lapse("the process that holds the robot's connections was silent")
                if self._renewed_until is not None and time.monotonic() > self._renewed_until:
                    self._stop()
        except (EOFError, OSError):
            self._go()

    def open(self, address: str, settings: dict[str, float]) -> None:
        """Connect, start the SDK's program on the controller.

        Raises RefusedError if people have to release it first.
        """
        from dashboard_client import DashboardClient
        from rtde_control import RTDEControlInterface
        from rtde_receive import RTDEReceiveInterface

        # As the parent's control loops, and all threads of the SDK with it; not while modules are loaded, which must
        # not keep other controllers waiting.
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REAL_TIME_PRIORITY))
        self._address, self._settings = address, settings
        self._dashboard = DashboardClient(address)
        self._dashboard.connect(int(1000 * settings["connect_timeout"]))
        self._check_released()
        self._receive = RTDEReceiveInterface(address, settings["rate"], VARIABLES)
        self._control = RTDEControlInterface(address, CONTROL_RATE, RTDEControlInterface.FLAG_UPLOAD_SCRIPT)
        self._upload()
        self._set_up()
        threading.Thread(target=self._report, name="reports", daemon=True).start()

    def recover(self) -> None:
        """Restart the program, discarding its interrupted command. Raises RefusedError like ``open``."""
        self._check_released()
        self._renewed_until = None
        self._upload()
        self._set_up()
        self._lapsed, self._followed = "", None

    def identity(self) -> tuple[str, str, list[float], list[float], list[float], float, list[float]]:
        """Return model, serial number, tool offset from the flange, and what ``arm`` returns."""
        offset = self._control.getTCPOffset()
        return self._dashboard.getRobotModel(), self._dashboard.getSerialNumber(), offset, *self.arm()

    def arm(self) -> tuple[list[float], list[float], float, list[float]]:
        """Return current joints, tool pose, load at the flange, kg, and the joint torques by the controller's model."""
        receive = self._receive
        return receive.getActualQ(), receive.getActualTCPPose(), receive.getPayload(), receive.getTargetMoment()

    def leave(self) -> None:
        """End set-points and the program."""
        if self._control is not None and self._control.isProgramRunning():
            if self._renewed_until is not None:
                self._stop()
            self._control.servoStop(self._settings["deceleration"])
            self._control.stopScript()
        self._control = None

    def set_output(self, kind: str, number: int, on: bool) -> bool:
        """Switch a digital output: ``standard``, ``configurable`` or ``tool``."""
        if self._io is None:
            from rtde_io import RTDEIOInterface

            self._io = RTDEIOInterface(self._address)
        setters = {
            "standard": self._io.setStandardDigitalOut,
            "configurable": self._io.setConfigurableDigitalOut,
            "tool": self._io.setToolDigitalOut,
        }
        return bool(setters[kind](number, on))

    def upload_path(self, path: list[list[float]]) -> None:
        """Upload a path as a program without starting it. Rows: positions (6,), speed, acceleration, blend radius."""
        self._busy = True
        try:
            self._upload(
                "".join(
                    f"    movej([{', '.join(f'{angle:.9f}' for angle in row[:6])}], a={row[7]:.6f}, v={row[6]:.6f}, "
                    f"r={row[8]:.6f})\n"
                    for row in path
                )
            )
            self._await(self._playing, PROGRAM_TIME, "it reports no program")
        finally:
            self._busy = False

    def start_path(self) -> bool:
        """Move along the uploaded path: command 1 of the program, whose own arguments are ignored."""
        begun = bool(self._control.moveJ(self._receive.getActualQ(), 0.1, 0.1, True))
        self._watch(self.stop_path)
        return begun

    def end_path(self) -> None:
        """End an arrived path, which needs no renewal."""
        self._renewed_until = None

    def speed(self, function: str, target: list[float], acceleration: float) -> bool:
        """Move at speeds until ``stop_speed``, or until ``renew`` is no longer called.

        The SDK's program has a thread that repeats ``speedj`` until ``speedStop``, regardless of its ``time``.
        """
        self._control.servoStop(self._settings["deceleration"])  # no two threads of the program may move the arm
        begun = bool(getattr(self._control, function)(target, acceleration, SPEED_TIME))
        self._kicked = time.monotonic()  # the SDK kicks with command 0 at once, over one not yet read
        self._watch(self.stop_speed)
        return begun

    def renew(self) -> None:
        """Renew the motion on behalf of the parent."""
        if self._renewed_until is None:
            raise RefusedError("the motion was not renewed in time")
        self._watch(self._stop)

    def stop_speed(self) -> None:
        """Brake, and end the program's thread when the arm rests: a ``stopj`` in motion would outlast the watchdog."""
        self._renewed_until = None
        deceleration = self._settings["deceleration"]
        self._come_to_rest(lambda: self._control.speedJ([0.0] * 6, deceleration, SPEED_TIME))
        self._control.speedStop(deceleration)

    def stop_path(self) -> None:
        """Brake along the current path."""
        self._renewed_until = None
        self._control.stopJ(self._settings["deceleration"], True)
        self._come_to_rest(self._control.kickWatchdog)

    def _upload(self, path: str = "") -> None:
        """Replace the program on the controller; its watchdog is set in its first line."""
        program = PROGRAM.replace("WATCHDOG_FREQUENCY", f"{self._settings['watchdog']:.3f}")
        os.ftruncate(self._program, 0)
        os.pwrite(self._program, program.replace(PATH_PLACE, PATH_PLACE + path).encode("ascii"), 0)
        self._control.setCustomScriptFile(f"/proc/self/fd/{self._program}")
        self._await(self._control.isProgramRunning, PROGRAM_TIME, "its program does not start")

    def _watch(self, stop: Callable[[], None]) -> None:
        """Start the watchdog on the parent: ``stop`` is called if a renewal is late, as the controller watches this
        process.
        """
        self._followed = None
        self._renewed_until, self._stop = time.monotonic() + 1.0 / self._settings["watchdog"], stop

    def _come_to_rest(self, keep_alive: Callable[[], object]) -> None:
        """Wait for that, and send heartbeats to the controller's watchdog meanwhile."""
        deadline = time.monotonic() + REST_TIME
        while time.monotonic() < deadline:
            keep_alive()
            self._kicked = time.monotonic()
            time.sleep(KICK_PERIOD)
            if max(map(abs, self._receive.getActualQd())) < AT_REST and not self._moves():
                return

    def _lapse(self, reason: str) -> None:
        """Brake, and ignore what the parent still sends."""
        self._heard, self._followed, self._lapsed = None, None, reason
        if self._control is None or not self._control.isProgramRunning():
            return
        if self._renewed_until is not None:
            self._stop()
        else:
            self._control.servoStop(self._settings["deceleration"])

    def _follow(self) -> None:
        target = None
        while self._stream.poll():
            target = self._stream.recv() or target
        self._heard = time.monotonic()
        if target is None or self._lapsed or self._control is None:
            return
        settings, now = self._settings, time.monotonic()
        if self._followed is None or now - self._followed_at > settings["heartbeat"]:
            self._followed = self._receive.getActualQ()  # people may have moved an arm that rested
        if max(abs(new - old) for new, old in zip(target, self._followed, strict=True)) > settings["longest_step"]:
            self._lapse("set-points were held up, and the next one was too far from the last")
            return
        self._followed, self._followed_at = target, now
        self._control.servoJ(target, 0.0, 0.0, 1.0 / settings["rate"], settings["lookahead"], settings["gain"])
        self._kicked = time.monotonic()

    def _answer(self, name: str, arguments: tuple[Any, ...]) -> None:
        try:
            result = self._answers[name](*arguments)
        except Exception as error:  # noqa: BLE001 - the parent is to hear of it
            words = str(error).replace(self._address, "its address") if self._address else str(error)
            self._calls.send((False, words))
        else:
            self._calls.send((True, result))
        if self._heard is not None:
            self._heard = time.monotonic()  # what has come meanwhile was not looked at

    def _check_released(self) -> None:
        """Raise if people have to release the robot: nothing is unlocked, powered on or restarted here, because
        Universal Robots requires that a person inspects the robot first.
        """
        dashboard = self._dashboard
        if not dashboard.isInRemoteControl():
            version = dashboard.polyscopeVersion()
            numbers = [int(number) for number in re.findall(r"\d+", version)[:2]]
            if tuple(numbers) < OLDEST:
                raise RefusedError(f"it runs {version}; an e-series with PolyScope 5.6 or newer is needed (no CB3)")
            raise RefusedError("remote control is off; switch it on at the teach pendant")
        safety, mode = dashboard.safetymode(), dashboard.robotmode()
        if any(word in safety for word in ("EMERGENCY", "SAFEGUARD")):
            raise RefusedError(f"it has to be released at the robot: {safety}")
        if not any(word in safety for word in ("NORMAL", "REDUCED")):
            raise RefusedError(f"{safety}: {LOOK_FIRST}")
        if "RUNNING" not in mode:
            raise RefusedError(f"{mode}: {LOOK_FIRST}")

    def _set_up(self) -> None:
        settings = self._settings
        if "payload" in settings:
            center = [settings[f"payload_{axis}"] for axis in "xyz"]
            self._control.setPayload(settings["payload"], center)
        self._await(self._playing, PROGRAM_TIME, "it reports no program")

    def _playing(self) -> bool:
        receive = self._receive
        return bool(receive.getRuntimeState() == PLAYING and receive.getRobotMode() == RUNNING)

    def _await(self, done: Callable[[], bool], limit: float, otherwise: str) -> None:
        deadline = time.monotonic() + limit
        while not done():
            if time.monotonic() > deadline:
                raise RefusedError(otherwise)
            time.sleep(0.02)
            self._control.kickWatchdog()

    def _report(self) -> None:
        receive, period, last = self._receive, 1.0 / self._settings["rate"], -1.0
        try:
            while True:
                time.sleep(period)
                stamp = receive.getTimestamp()
                if stamp != last:
                    last = stamp
                    report = Report(
                        time.monotonic(),
                        stamp,
                        receive.getActualQ(),
                        receive.getActualQd(),
                        receive.getTargetMoment(),
                        receive.getActualTCPPose(),
                        receive.getFtRawWrench(),
                        receive.getActualDigitalInputBits(),
                        receive.getActualDigitalOutputBits(),
                        receive.getRobotMode(),
                        receive.getSafetyMode(),
                        receive.getRuntimeState(),
                        self._busy,
                        self._moves(),
                        self._lapsed,
                        receive.getSpeedScalingCombined(),
                    )
                    self._stream.send(tuple(report))
        except OSError:
            return  # the parent is gone; the main thread ends the process

    def _moves(self) -> bool:
        control = self._control
        return control is not None and bool(control.getAsyncOperationProgressEx().isAsyncOperationRunning())

    def _go(self) -> None:
        """Bring the arm to rest, if the controller answers, after the parent is gone, and exit."""
        threading.Timer(1.0, os._exit, (1,)).start()
        try:
            self.leave()
        finally:
            os._exit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent's to handle
    SDKProcess(Connection(int(sys.argv[1])), Connection(int(sys.argv[2]))).serve()
