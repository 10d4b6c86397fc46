"""The twins in a process of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.rigs.twinned_robots import XARM6

pytestmark = [pytest.mark.real_time, pytest.mark.slow]

STARTER = """
import os, signal, sys
from hal.twins.process import TwinProcess
twin = TwinProcess(sys.argv[1], "pick_place_table")
twin.start()
print(twin.process.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_twins_end_with_the_program_that_started_them() -> None:
    arguments = [sys.executable, "-c", STARTER, str(XARM6.robot_file)]
    done = subprocess.run(arguments, stdout=subprocess.PIPE, text=True, check=False, timeout=120)
    assert done.returncode == -signal.SIGKILL
    process = Path(f"/proc/{int(done.stdout)}")
    deadline = time.monotonic() + 15.0
    while process.exists() and "Z" not in (process / "stat").read_text().split()[2]:
        assert time.monotonic() < deadline, "the twins go on"
        time.sleep(0.1)
