"""``bestman-bt replay`` tells what it cannot open, before it opens anything."""

from __future__ import annotations

import signal
import socket
from pathlib import Path

import pytest
import rerun

from bestman_bt.cli.replay_command import command
from bestman_bt.configuration.errors import ConfigurationError
from tests.cli.command_line import Program


def test_a_folder_without_a_recording_is_reported_with_what_shows_it(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigurationError, match=r"has no recording\.rrd; simulated runs with --record .*bestman-bt monitor"
    ):
        command([tmp_path])


def test_a_folder_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nothing: there is no such run folder or file"):
        command([tmp_path / "nothing"])


def test_a_damaged_recording_is_reported(tmp_path: Path) -> None:
    (tmp_path / "recording.rrd").write_bytes(b"<script>" * 100)
    with pytest.raises(ConfigurationError, match=r"recording\.rrd: is not a Rerun recording"):
        command([tmp_path], browser=True)


def test_without_a_window_system_the_browser_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ConfigurationError, match="--browser"):
        command([], browser=False)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_the_viewer_ends_with_the_command_however_that_is_ended(tmp_path: Path, number: signal.Signals) -> None:
    recording = rerun.RecordingStream("test_of_replay")
    recording.save(tmp_path / "recording.rrd")
    recording.log("x", rerun.Scalars(1.0))
    recording.flush()
    program = Program("replay", tmp_path, "--browser", folder=tmp_path)
    assert program.process.stdout is not None
    page = program.process.stdout.readline()
    port = int(page.removeprefix("http://127.0.0.1:").partition("/")[0])
    socket.create_connection(("127.0.0.1", port), timeout=5.0).close()
    program.process.send_signal(number)
    assert program.answer(timeout=30.0).code == 0
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=5.0)
