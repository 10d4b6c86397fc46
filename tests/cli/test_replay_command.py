"""``bestman-bt replay`` tells what it cannot open, before it opens anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.cli.replay_command import command
from bestman_bt.configuration import ConfigurationError


def test_a_folder_without_a_recording_is_told_with_what_shows_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"has no recording\.rrd; runs with --record .*bestman-bt monitor"):
        command([tmp_path])


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nothing: there is no such run folder or file"):
        command([tmp_path / "nothing"])


def test_a_damaged_recording_is_told(tmp_path: Path) -> None:
    (tmp_path / "recording.rrd").write_bytes(b"<script>" * 100)
    with pytest.raises(ConfigurationError, match=r"recording\.rrd: is no Rerun recording"):
        command([tmp_path], browser=True)


def test_without_a_window_system_the_browser_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ConfigurationError, match="--browser"):
        command([], browser=False)
