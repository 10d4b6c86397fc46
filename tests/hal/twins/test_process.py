"""The twins in a process of their own."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hal.twinned import wait_for
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
    stat = Path(f"/proc/{int(done.stdout)}/stat")

    def ended() -> bool:
        try:
            return stat.read_text().rpartition(")")[2].split()[0] == "Z"
        except (FileNotFoundError, ProcessLookupError):
            return True

    wait_for(ended, "the twins end")
