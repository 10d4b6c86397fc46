"""Signs of life: a process that computes gives them, one that is stopped or dead does not, one that is back does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from hal.hardware.heartbeat import Heartbeat
from tests.hal.twinned import wait_for

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

OTHER = """
import re, sys
from hal.hardware.heartbeat import Heartbeat
heartbeat = Heartbeat(0.2, sys.argv[1])
sys.stdin.readline()
re.match("(a+)+$", "a" * 25 + "b")  # holds the interpreter's lock for about a second
print("computed", flush=True)
sys.stdin.readline()
heartbeat.close()
"""


@pytest.fixture
def heartbeat() -> Iterator[Heartbeat]:
    heartbeat = Heartbeat(0.2)
    yield heartbeat
    heartbeat.close()


def test_a_stopped_process_is_silent_one_that_goes_on_is_found_again_and_one_that_computes_is_never_missed(
    heartbeat: Heartbeat,
) -> None:
    command = [sys.executable, "-c", OTHER, heartbeat.address]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        wait_for(lambda: heartbeat.met, "both ends meet")
        other.stdin.write("\n")
        other.stdin.flush()
        assert other.stdout.readline() == "computed\n"
        assert heartbeat.silence == 0.0
        os.kill(other.pid, signal.SIGSTOP)
        wait_for(lambda: heartbeat.silence > 0.0, "the stopped process is missed")
        os.kill(other.pid, signal.SIGCONT)
        wait_for(lambda: heartbeat.silence == 0.0, "it is found again")
        other.kill()
        wait_for(lambda: heartbeat.silence > 0.0, "the dead process is missed")
