"""The pipe to the process that runs ur-rtde: calls, set-points, and the age of the newest reading."""

from __future__ import annotations

import contextlib
import multiprocessing
import select
import subprocess
import sys
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

from hal.api import Clock
from hal.hardware.clock import LatencyMonitor, RemoteTime
from hal.parts.part_connection import ConnectionFailedError
from hal.ur import sdk_process
from hal.ur.sdk_process import Report

LEAVE_TIME = 1.0
BEAT_PERIOD = 0.02


class URLink:
    """One SDK process at a time; thread-safe."""

    def __init__(self, name: str, clock: Clock) -> None:
        self._name = name
        self._clock_offset = clock.now() - time.monotonic()
        self._process: subprocess.Popen[bytes] | None = None
        self._calls: Connection | None = None
        self._stream: Connection | None = None
        self._arrived = select.poll()
        self._calling, self._reading = threading.Lock(), threading.Lock()
        self._report: Report | None = None
        self._sent = 0.0
        self._controller_time = RemoteTime()
        self._lateness = LatencyMonitor()

    def open(self, address: str, settings: dict[str, float], timeout: float) -> None:
        """Start the process and wait until it is connected. Raises ConnectionFailedError with the reason."""
        calls, calls_there = multiprocessing.Pipe()
        stream, stream_there = multiprocessing.Pipe()
        numbers = (calls_there.fileno(), stream_there.fileno())
        self._process = subprocess.Popen(
            [sys.executable, "-P", sdk_process.__file__, *map(str, numbers)],
            pass_fds=numbers,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        calls_there.close()
        stream_there.close()
        self._calls, self._stream = calls, stream
        self._arrived = select.poll()
        self._arrived.register(stream, select.POLLIN)
        self._report = None
        self._lateness.forget()
        self._controller_time.forget()
        self.call("open", address, settings, timeout=timeout)
        deadline = time.monotonic() + 1.0
        while self.pump() is None:
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self._name}: the UR controller sends no readings")
            time.sleep(0.005)

    def call(self, name: str, *arguments: Any, timeout: float) -> Any:
        """Return the answer of the SDK's process. Raises ConnectionFailedError on a refusal or a timeout."""
        with self._calling:
            calls = self._calls
            if calls is None:
                raise ConnectionFailedError(f"{self._name}: the UR controller is not connected")
            try:
                calls.send((name, arguments))
                if not calls.poll(timeout):
                    self.kill()  # its further effect is unknown
                    raise ConnectionFailedError(f"{self._name}: the UR controller does not answer within {timeout:g} s")
                well, result = calls.recv()
            except (EOFError, OSError) as error:
                raise ConnectionFailedError(f"{self._name}: the process of the UR's SDK has ended") from error
        if not well:
            raise ConnectionFailedError(f"{self._name}: the UR controller cannot be used: {result}")
        return result

    def beat(self) -> None:
        """Send a heartbeat if no set-point was sent."""
        if time.monotonic() - self._sent > BEAT_PERIOD:
            self.send(None)

    def send(self, positions: list[float] | None) -> None:
        """Send one set-point or heartbeat; if the process is gone, the watchdog notices."""
        stream = self._stream
        if stream is not None:
            try:
                self._sent = time.monotonic()
                stream.send(positions)
            except OSError:
                self._stream = None

    @property
    def alive(self) -> bool:
        """Return whether the SDK's process runs and can be called."""
        process = self._process
        return process is not None and self._calls is not None and process.poll() is None

    @property
    def report(self) -> Report | None:
        """The newest report that ``pump`` has found."""
        return self._report

    def pump(self) -> Report | None:
        """Read pending reports. Returns the newest, None before the first."""
        with self._reading:
            stream = self._stream
            try:
                newest = None
                while stream is not None and self._arrived.poll(0):
                    newest = stream.recv()
            except (EOFError, OSError):
                self._stream = None
            if newest is not None:
                self._note(Report(*newest))
            return self._report

    @property
    def heard(self) -> float:
        """Clock time at which the controller took the newest reading, seconds."""
        report = self.pump()
        return report.time - self._lateness.lag + self._clock_offset if report is not None else -1e9

    @property
    def age(self) -> float:
        """Seconds since the controller took the newest reading that ``pump`` has found."""
        report = self._report
        return time.monotonic() - report.time + self._lateness.lag if report is not None else float("inf")

    def late(self, longest_delay: float) -> float | None:
        """Return the delay of recent readings if it exceeds ``longest_delay``, else None."""
        return self._lateness.late(longest_delay, time.monotonic())

    def close(self) -> None:
        """Make the process stop the arm and end its program, then end the process; idempotent, raises nothing."""
        if self._process is not None:
            with contextlib.suppress(ConnectionFailedError):  # where it cannot, the controller's watchdog does
                self.call("leave", timeout=LEAVE_TIME)
        self.kill()

    def abandon(self) -> None:
        """End the process without waiting for its end; ``close`` frees the resources."""
        process = self._process
        if process is not None:
            process.kill()

    def kill(self) -> None:
        """End the process immediately; idempotent."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
        for pipe in (self._calls, self._stream):
            if pipe is not None:
                pipe.close()
        self._calls = self._stream = None

    def _note(self, report: Report) -> None:
        self._lateness.lag = report.time - self._controller_time.here(report.stamp, report.time)
        self._report = report
