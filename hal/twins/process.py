"""Runs the twins in a separate process, as a context manager."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self, TextIO

from hal.twins.errors import TwinError
from hal.twins.tcp_server import ask


class TwinProcess:
    """``bestman-bt twin`` in the background, as a context manager; ends with the context, or with this process. Its
    messages go to standard error: that the machine is too slow, or why a controller stopped.

    ``addresses``: connection → address. ``settings``: dotted keys → values that connect a robot's YAML to the twins.
    ``board``: where a calibration board is, as ``bestman-bt twin --board`` takes it.
    """

    def __init__(
        self,
        robot: str | Path,
        scene: str | Path,
        seed: int = 0,
        settings: Sequence[str] = (),
        start_timeout: float = 180.0,
        board: str | None = None,
    ) -> None:
        self._command = [
            sys.executable,
            "-m",
            "bestman_bt.cli.main",
            "twin",
            "--robot",
            str(robot),
            "--scene",
            str(scene),
        ]
        self._command += ["--seed", str(seed), "--judge", "--json", "--until-eof"]
        self._command += [word for setting in settings for word in ("--set", setting)]
        self._command += [] if board is None else ["--board", board]
        self._start_timeout = start_timeout
        self._process: subprocess.Popen[str] | None = None
        self._relay = threading.Thread()
        self._announced: dict[str, Any] = {}

    @property
    def process(self) -> subprocess.Popen[str]:
        """The process. Raises RuntimeError before ``start``."""
        if self._process is None:
            raise RuntimeError("the twins were not started")
        return self._process

    @property
    def addresses(self) -> Mapping[str, str]:
        """Connection → address."""
        addresses: dict[str, str] = self._announced["addresses"]
        return addresses

    @property
    def settings(self) -> dict[str, str]:
        """Return the settings for ``load_robot_model(name, settings)``."""
        settings = (setting.removeprefix("robot.").partition("=") for setting in self._announced["settings"])
        return {key: value for key, _, value in settings}

    def fault(self, connection: str, name: str, value: float | None = None) -> None:
        """Trigger a fault of a controller."""
        question = {"connection": connection, "fault": name}
        ask(Path(self._announced["faults"]), question if value is None else {**question, "value": value})

    @property
    def judge_socket(self) -> Path:
        """Return the address for ``RemoteTruth``."""
        return Path(self._announced["judge"])

    def judge(self, question: str, name: str = "") -> Any:
        """Return the judge's answer to a question about the ground truth."""
        return ask(self.judge_socket, {"ask": question, "name": name})["answer"]

    def start(self) -> None:
        """Start, and wait until the ports are open. Raises TwinError with the output of the process."""
        self._process = process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.PIPE, text=True
        )
        output, errors = process.stdout, process.stderr
        assert output is not None
        assert errors is not None
        said: list[str] = []
        self._relay = threading.Thread(target=_relay, args=(errors, said), daemon=True)
        self._relay.start()
        first: queue.SimpleQueue[str] = queue.SimpleQueue()
        threading.Thread(target=lambda: first.put(output.readline()), daemon=True).start()
        try:
            line = first.get(timeout=self._start_timeout)
        except queue.Empty:
            line = ""
        if not line.strip():
            process.kill()
            self.close()
            raise TwinError(f"the twins did not start: {(said or ['no output'])[-1]}")
        self._announced = json.loads(line)

    def close(self) -> None:
        """End the process; idempotent."""
        process, self._process = self._process, None
        if process is None:
            return
        with process:  # closes the pipes
            process.terminate()
            try:
                process.wait(timeout=5.0)
            except subprocess.TimeoutExpired:
                process.kill()
            self._relay.join(1.0)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _relay(errors: TextIO, said: list[str]) -> None:
    """Pass on what the process writes, and keep it."""
    for line in errors:
        said.append(line.rstrip())
        with contextlib.suppress(OSError, ValueError):  # the twins must not wait for a reader
            sys.stderr.write(line)
