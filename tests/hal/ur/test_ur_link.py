"""How old the newest report of a UR's controller is, told by a process that a test scripts in place of the SDK's."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

import hal.ur.link
from hal.hardware.clock import RealTimeClock
from hal.ur.link import URLink

PROCESS = """
import sys, time
from multiprocessing.connection import Connection
calls, stream = (Connection(int(number)) for number in sys.argv[1:3])
_, (address, settings) = calls.recv()
calls.send((True, None))
time.sleep(0.05)
late = 0.0
while True:
    now, zeros = time.monotonic(), [0.0] * 6
    stream.send((now, settings["ahead"] + now - late, zeros, zeros, zeros, zeros, zeros, 0, 0, 7, 1, 2, False, False))
    late = settings["late"]
    if calls.poll(0.01):
        calls.recv()
        calls.send((True, None))
"""
"""``ahead``: seconds by which the controller's clock is ahead of ours. ``late``: by which all reports but one come."""


@pytest.fixture
def link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[URLink]:
    script = tmp_path / "process.py"
    script.write_text(PROCESS)
    monkeypatch.setattr(hal.ur.link, "sdk_process", SimpleNamespace(__file__=str(script)))
    made = URLink("arm_controller", RealTimeClock())
    yield made
    made.close()


def reports(link: URLink, count: int) -> None:
    """Wait for so many reports one after the other."""
    for _ in range(count):
        last, deadline = link.report, time.monotonic() + 60.0
        while link.pump() is last:
            assert time.monotonic() < deadline
            time.sleep(0.002)


def test_a_report_that_was_long_under_way_is_as_old_as_its_stamp_says(link: URLink) -> None:
    link.open("", {"ahead": 5.0, "late": 30.0}, 60.0)
    reports(link, 2)
    assert link.age > 29.9
    assert link.heard < -29.0
    assert link.late(0.15) is None  # not for a while yet


def test_connected_anew_stamps_are_of_the_clock_that_the_controller_has_now(link: URLink) -> None:
    for ahead in (1000.0, 400.0):
        before = link.report
        link.open("", {"ahead": ahead, "late": 0.0}, 60.0)
        assert link.report is not before
        reports(link, 2)
        assert link.age < 60.0
        link.close()
