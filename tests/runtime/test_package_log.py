"""What our packages log while a run goes on, and that logging is as before afterwards."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from bestman_bt.records.events import LogEvent
from bestman_bt.runtime.telemetry import PACKAGES, PackageLog


@pytest.fixture
def hal() -> Iterator[logging.Logger]:
    logger = logging.getLogger("hal")
    before = logger.level
    yield logger
    logger.setLevel(before)


@pytest.mark.parametrize(
    ("level", "meanwhile"),
    [(logging.DEBUG, logging.DEBUG), (logging.INFO, logging.INFO), (logging.ERROR, logging.INFO)],
)
def test_a_logger_tells_at_least_what_a_run_keeps_and_has_its_own_level_again_afterwards(
    hal: logging.Logger, level: int, meanwhile: int
) -> None:
    hal.setLevel(level)
    before = [(logging.getLogger(name).level, list(logging.getLogger(name).handlers)) for name in PACKAGES]
    with PackageLog(lambda event: None, lambda: 0.0):
        assert hal.level == meanwhile
    assert [(logging.getLogger(name).level, list(logging.getLogger(name).handlers)) for name in PACKAGES] == before


def test_each_line_has_time_level_logger_and_the_exception_that_it_tells_of(hal: logging.Logger) -> None:
    told: list[LogEvent] = []
    with PackageLog(told.append, lambda: 2.5):
        arm = logging.getLogger("hal.arm")
        arm.debug("not kept")
        arm.warning("at %d %%", 90)
        arm.log(logging.WARNING + 1, "between two levels")
        try:
            raise OSError("no answer")
        except OSError:
            arm.exception("it broke")
    arm.error("after the run")
    words, _, trace = told[-1].message.partition("\n")
    assert trace.startswith("Traceback")
    assert trace.endswith("OSError: no answer")
    assert [(line.level, line.message) for line in told[:-1]] + [(told[-1].level, words)] == [
        ("warning", "at 90 %"),
        ("warning", "between two levels"),
        ("error", "it broke: OSError('no answer')"),
    ]
    assert {(line.time, line.logger) for line in told} == {(2.5, "hal.arm")}
