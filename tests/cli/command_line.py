"""The command line as a user has it: in this process, or as a program of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Answer:
    """Exit code and what was printed."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        """Standard output as the one JSON document that it holds."""
        document: dict[str, Any] = json.loads(self.out)
        return document


class Program:
    """``bestman-bt`` in a process group of its own."""

    def __init__(self, *arguments: object, folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bestman_bt.cli.main", *(str(argument) for argument in arguments)],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def answer(self, timeout: float = 120.0) -> Answer:
        """Wait for its end."""
        try:
            out, err = self.process.communicate(timeout=timeout)
        finally:
            if self.process.poll() is None:
                self.process.kill()
        return Answer(self.process.returncode, out, err)


def wait_for(folder: Path, pattern: str, timeout: float = 180.0) -> Path:
    """The first file that matches, as soon as it is there."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        found = sorted(folder.glob(pattern))
        if found:
            return found[0]
        time.sleep(0.02)
    raise AssertionError(f"no {pattern} came to be in {folder}")


def files_in(folder: Path) -> set[Path]:
    """Everything below a folder but the byte code that Python keeps of imported files."""
    return {path for path in folder.rglob("*") if "__pycache__" not in path.parts}
