"""The folder of sockets and locks belongs to its user alone, whoever was there before."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from bestman_bt.monitor.control_client import ControlError, socket_folder
from bestman_bt.runtime_folder import runtime_folder


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def named(base: Path) -> Path:
    return base / f"bestman-bt-{os.getuid()}"


def test_it_is_made_for_its_user_alone_whatever_the_mask(base: Path) -> None:
    mask = os.umask(0)
    try:
        assert runtime_folder() == named(base)
    finally:
        os.umask(mask)
    assert stat.S_IMODE(named(base).stat().st_mode) == 0o700


def test_one_that_others_could_enter_is_closed_to_them(base: Path) -> None:
    named(base).mkdir()
    named(base).chmod(0o777)
    assert stat.S_IMODE(runtime_folder().stat().st_mode) == 0o700


def test_one_of_another_user_is_refused(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    uid = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: uid + 1)
    named(base).mkdir()
    with pytest.raises(PermissionError, match=f"bestman-bt-{uid + 1}"):
        runtime_folder()
    with pytest.raises(ControlError, match=f"bestman-bt-{uid + 1}"):
        socket_folder()


@pytest.mark.parametrize("what", ["file", "link", "link to nothing"])
def test_what_is_no_folder_is_refused(base: Path, what: str) -> None:
    """A link of somebody else could lead to another place a moment later."""
    if what == "file":
        named(base).touch()
    else:
        named(base).symlink_to(base / "elsewhere")
    if what == "link":
        (base / "elsewhere").mkdir(mode=0o755)
    with pytest.raises(PermissionError, match="is not a folder of this user"):
        runtime_folder()
    assert not (base / "elsewhere").exists() or stat.S_IMODE((base / "elsewhere").stat().st_mode) == 0o755


def test_without_a_runtime_folder_of_the_system_it_lies_among_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for told in ("", str(tmp_path / "missing")):
        monkeypatch.setenv("XDG_RUNTIME_DIR", told)
        assert runtime_folder() == named(tmp_path)
