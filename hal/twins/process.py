"""Runs the twins in a separate process, as a context manager."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from hal.twins.errors import TwinError
from hal.twins.tcp_server import ask


class TwinProcess:
    """``bestman-bt twin`` in the background, as a context manager; ends with it, or with this process.

    ``addresses``: connection → address. ``settings``: dotted keys → values that direct a robot's YAML to the twins.
    """

    def __init__(
        self,
        robot: str | Path,
        scene: str | Path,
        seed: int = 0,
        settings: Sequence[str] = (),
        start_timeout: float = 180.0,
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
        self._start_timeout = start_timeout
        self._process: subprocess.Popen[str] | None = None
        self._told: dict[str, Any] = {}

    @property
    def process(self) -> subprocess.Popen[str]:
        """The process. Raises RuntimeError before ``start``."""
        if self._process is None:
            raise RuntimeError("the twins were not started")
        return self._process

    @property
    def addresses(self) -> Mapping[str, str]:
        """Connection → address."""
        addresses: dict[str, str] = self._told["addresses"]
        return addresses

    @property
    def settings(self) -> dict[str, str]:
        """For ``load_robot_model(name, settings)``."""
        settings = (setting.removeprefix("robot.").partition("=") for setting in self._told["settings"])
        return {key: value for key, _, value in settings}

    def fault(self, connection: str, name: str, value: float | None = None) -> None:
        """Trigger a fault of a controller."""
        question = {"connection": connection, "fault": name}
        ask(Path(self._told["faults"]), question if value is None else {**question, "value": value})

    @property
    def judge_socket(self) -> Path:
        """Return the address for ``RemoteTruth``."""
        return Path(self._told["judge"])

    def judge(self, question: str, name: str = "") -> Any:
        """Return the judge's answer to a question about the ground truth."""
        return ask(self.judge_socket, {"ask": question, "name": name})["answer"]

    def start(self) -> None:
        """Start, and wait until the ports are open. Raises TwinError with the output of the process."""
        with tempfile.TemporaryFile("w+") as errors:  # no pipe: their later output is not read
            self._process = subprocess.Popen(
                self._command, stdout=subprocess.PIPE, stderr=errors, stdin=subprocess.PIPE, text=True
            )
            first: queue.SimpleQueue[str] = queue.SimpleQueue()
            output = self._process.stdout
            assert output is not None
            threading.Thread(target=lambda: first.put(output.readline()), daemon=True).start()
            try:
                line = first.get(timeout=self._start_timeout)
            except queue.Empty:
                line = ""
            if not line.strip():
                self._process.kill()
                self._process.communicate()
                errors.seek(0)
                said = errors.read().strip().splitlines() or ["they said nothing"]
                raise TwinError(f"the twins did not start: {said[-1]}")
        self._told = json.loads(line)

    def close(self) -> None:
        """End the process; idempotent."""
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.communicate(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
        self._process = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
