"""A machine that is too slow for the twins is told, with what was late; one that keeps up is not."""

from __future__ import annotations

import pytest

from hal.twins.machine_watch import PERIOD, MachineWatch


@pytest.mark.parametrize(
    ("given_up", "age", "pixels", "words"),
    [
        (0.4, 0.29, 640 * 480, None),
        (0.6, 0.0, 640 * 480, "the world lost 0.6 s"),
        (0.0, 0.31, 640 * 480, "frames of head_camera were up to 0.31 s old"),
        (0.0, 0.14, 320 * 240, None),
        (0.0, 0.16, 320 * 240, "0.16 s old"),
    ],
)
def test_what_was_late_is_reported_once_per_period(given_up: float, age: float, pixels: int, words: str | None) -> None:
    now, told = [10.0], list[str]()
    watch = MachineWatch(told.append, lambda: now[0])
    for _ in range(2):
        watch.given_up += given_up
        watch.frame("head_camera", age, pixels)
        watch.frame("head_camera", age / 2, pixels)
        now[0] += PERIOD - 0.01
        watch.look()
        now[0] += 0.01
        watch.look()
        watch.look()
    assert len(told) == (0 if words is None else 2)
    assert all(words is not None and words in text for text in told)
    now[0] += PERIOD
    watch.look()
    assert len(told) == (0 if words is None else 2)
