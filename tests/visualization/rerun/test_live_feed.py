"""A recording reaches whoever reads it while it is written, and nobody waits for one who does not."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from bestman_bt.visualization.rerun.viewer import LiveFeed


def test_all_that_is_appended_arrives_and_then_the_end(tmp_path: Path) -> None:
    file = tmp_path / "recording.rrd"
    reading, writing = os.pipe()
    with (
        LiveFeed(file, os.fdopen(writing, "wb")),
        os.fdopen(reading, "rb") as pipe,
        file.open("wb", buffering=0) as recording,
    ):
        recording.write(b"first")
        assert pipe.read(5) == b"first"
        recording.write(b", second")
        assert pipe.read(8) == b", second"
        recording.write(b" and last")
    assert file.read_bytes() == b"first, second and last"


def test_what_is_written_last_arrives_before_the_end(tmp_path: Path) -> None:
    file = tmp_path / "recording.rrd"
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as pipe:
        with LiveFeed(file, os.fdopen(writing, "wb")):
            file.write_bytes(b"all at once")
        assert pipe.read() == b"all at once"


@pytest.mark.slow
def test_a_frozen_viewer_holds_up_nobody(tmp_path: Path) -> None:
    file = tmp_path / "recording.rrd"
    reading, writing = os.pipe()

    def record() -> None:
        with LiveFeed(file, os.fdopen(writing, "wb")), file.open("wb") as recording:
            for _ in range(20):
                recording.write(bytes(1 << 20))

    recording = threading.Thread(target=record)
    recording.start()
    recording.join(20.0)
    held_up = recording.is_alive()
    os.close(reading)  # which ends the feed
    assert not held_up
    assert file.stat().st_size == 20 << 20


def test_a_viewer_that_was_closed_is_no_error(tmp_path: Path) -> None:
    file = tmp_path / "recording.rrd"
    reading, writing = os.pipe()
    os.close(reading)
    with LiveFeed(file, os.fdopen(writing, "wb")):
        file.write_bytes(bytes(1 << 20))
    assert file.stat().st_size == 1 << 20


def test_a_run_that_never_began_to_record_ends_the_pipe_with_nothing_in_it(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as pipe:
        with LiveFeed(tmp_path / "none.rrd", os.fdopen(writing, "wb")):
            pass
        assert pipe.read() == b""
    assert not (tmp_path / "none.rrd").exists()
