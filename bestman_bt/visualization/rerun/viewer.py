"""The Rerun viewer in a separate process, for this machine only: its default serves the whole network."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import IO

from bestman_bt.extras import require_extra
from bestman_bt.visualization.errors import RecordingError, ViewerError

# Hands a recording on to a viewer while it is written.
# The recorder writes to a file and knows nothing of the viewer: one that is slow or frozen holds up the thread here,
# and no tick. Streaming to it directly would do that: Rerun's streams wait for a receiver that is some hundred MB
# behind.


POLL = 0.1
CHUNK = 1 << 20
LAST_WORDS = 2.0
"""Seconds that the viewer gets at the end to receive the remaining data."""


class LiveFeed:
    """Copies new data of ``file``, which may not exist yet, to ``pipe``, between ``open`` and ``close``."""

    def __init__(self, file: Path, pipe: IO[bytes]) -> None:
        self._file = file
        self._pipe = pipe
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._copy, name="live-feed", daemon=True)

    def __enter__(self) -> LiveFeed:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join(LAST_WORDS)

    def _copy(self) -> None:
        while not self._file.exists() and not self._done.wait(POLL):
            pass
        # Until the viewer is closed; or nothing was recorded.
        with contextlib.suppress(OSError), self._pipe, self._file.open("rb") as file:
            while True:
                ended = self._done.is_set()
                while chunk := file.read(CHUNK):
                    self._pipe.write(chunk)
                    self._pipe.flush()
                if ended:
                    return
                self._done.wait(POLL)


# Whether a file is a recording, before a viewer is asked to open it.
# Rerun's own reader refuses what a killed run leaves, which its viewer opens; so the frames of the format are followed:
# 12 bytes of ``RRF2``, version and options, then messages of u64 kind, u64 length and that many bytes, little endian;
# kind 0 is the end, with a footer behind it.


_HEAD = struct.Struct("<4s4s4s")
_MESSAGE = struct.Struct("<QQ")
_END, _LAST_KIND = 0, 3


def check_recording(path: Path) -> None:
    """Raise RecordingError if ``path`` is not a recording, is damaged, or is empty.

    A recording that ends within a message, because the run was killed, is accepted.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
        if head[:4] != b"RRF2" or len(head) < _HEAD.size:
            raise RecordingError(f"is not a Rerun recording: it begins with {head[:4]!r} instead of b'RRF2'")
        messages = 0
        while len(frame := file.read(_MESSAGE.size)) == _MESSAGE.size:
            kind, length = _MESSAGE.unpack(frame)
            at = file.tell()
            if kind == _END:
                break
            if kind > _LAST_KIND:
                raise RecordingError(f"is a damaged Rerun recording: at byte {at} is a message of kind {kind}")
            messages += 1
            file.seek(min(length, size - at), 1)
    if messages == 0:
        raise RecordingError("is an empty Rerun recording")


LOOPBACK = "127.0.0.1"
STOP_WAIT = 5.0


class Display(StrEnum):
    """The output of a viewer."""

    WINDOW = "window"
    BROWSER = "browser"  # serves a page
    NONE = "none"  # pictures are asked for
    RELAY = "relay"  # no viewer: hands on to viewers what it is fed


@dataclass(frozen=True)
class ViewerOptions:
    """Options of a viewer. ``port``: of the recordings. ``page_port``: of the page for the browser. None: a free port.

    ``fed``: show data from ``pipe``; a page or a relay starts to serve when data arrives. ``source``: the address of a
    page or relay to show. ``size``: pixels, without a display. ``memory_limit``: beyond it the oldest data is dropped.
    ``start_timeout``: seconds.
    """

    display: Display
    port: int | None = None
    page_port: int | None = None
    fed: bool = False
    source: str | None = None
    size: tuple[int, int] = (1920, 1080)
    memory_limit: str = "2GB"
    start_timeout: float = 30.0


class RerunViewer:
    """A running viewer; ``stop`` ends it.

    ``recordings``: files to open. ``output``: receives its output. Raises ViewerError with its output if it does not
    start, MissingExtraError if rerun is not installed.
    """

    def __init__(self, options: ViewerOptions, recordings: Sequence[Path], output: IO[str]) -> None:
        require_extra("the Rerun viewer", "rerun")
        with ExitStack() as held:  # both ports at once, so that they differ
            self.port = options.port or _free_port(held)
            self.page_port = options.page_port or _free_port(held)
        self._display = options.display
        self._output = output
        command = [
            *(sys.executable, "-m", "rerun_cli", "--bind", LOOPBACK, "--port", str(self.port)),
            *("--memory-limit", options.memory_limit, "--server-memory-limit", options.memory_limit),
            "--hide-welcome-screen",
        ]
        if options.display is Display.BROWSER:
            command += ["--serve-web", "--web-viewer-port", str(self.page_port)]
        elif options.display is Display.NONE:
            width, height = options.size
            command += ["--headless", "--window-size", f"{width}x{height}"]
        elif options.display is Display.RELAY:
            command.append("--serve-grpc")
        if options.source is not None:
            command += ["--connect", options.source]
        self._process = subprocess.Popen(
            [*command, *(str(recording.resolve()) for recording in recordings), *["-"] * options.fed],
            stdin=subprocess.PIPE if options.fed else subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=output,
            start_new_session=True,
        )
        if not options.fed:
            try:
                self.wait_until_up(options.start_timeout)
            except ViewerError:
                self.stop()
                raise

    @property
    def address(self) -> str:
        """Return the address for other viewers."""
        return f"rerun+http://{LOOPBACK}:{self.port}/proxy"

    @property
    def pipe(self) -> IO[bytes]:
        """Return the pipe that receives a recording. Raises ViewerError if the viewer is not ``fed``."""
        if self._process.stdin is None:
            raise ViewerError("this viewer was started to show files and accepts no data")
        return self._process.stdin

    @property
    def page(self) -> str:
        """Return the address of the page for a browser."""
        return f"http://{LOOPBACK}:{self.page_port}/?url=rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{self.port}%2Fproxy"

    def wait(self) -> int:
        """Wait until the viewer is closed. Returns its exit code."""
        return self._process.wait()

    def stop(self) -> None:
        """End the viewer with the launcher that started it: both are in their own session."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGTERM)
        try:
            self._process.wait(timeout=STOP_WAIT)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def output(self) -> str:
        """Return the output of a failed viewer: from its panic on, else the end."""
        self._output.seek(0)
        text = self._output.read()
        panic = text.find("panicked at")
        return text[panic : panic + 300].strip() if panic >= 0 else text[-300:].strip()

    def wait_until_up(self, timeout: float) -> None:
        """Wait until the viewer serves. Raises ViewerError after ``timeout`` seconds."""
        ports = [self.port] + [self.page_port] * (self._display is Display.BROWSER)
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise ViewerError(f"the viewer stopped with code {self._process.returncode}: {self.output()}")
            if all(_answers(port) for port in ports):
                return
            time.sleep(0.1)
        raise ViewerError(f"the viewer did not start within {timeout:g} s")


def has_window_system() -> bool:
    """Return whether this machine can open windows."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _free_port(held: ExitStack) -> int:
    probe = held.enter_context(socket.socket())
    probe.bind((LOOPBACK, 0))
    port: int = probe.getsockname()[1]
    return port


def _answers(port: int) -> bool:
    try:
        socket.create_connection((LOOPBACK, port), timeout=0.5).close()
    except OSError:
        return False
    return True
