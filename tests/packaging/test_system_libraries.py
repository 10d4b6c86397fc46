"""Shared libraries that pip cannot bring: found, named with their Debian packages, installed where that is free."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "system_libraries.py"
ABSENT = "libthat-no-system-has.so.7"


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, for a project that needs the C library and one library that no system has."""
    specification = importlib.util.spec_from_file_location("system_libraries", SCRIPT)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    monkeypatch.setattr(module, "DEBIAN_PACKAGES", {"libc.so.6": "libc6", ABSENT: "libabsent7"})
    return module


def put_on_path(folder: Path, monkeypatch: pytest.MonkeyPatch, **programs: str) -> None:
    for name, body in programs.items():
        file = folder / name.replace("_", "-")
        file.write_text(f"#!/bin/sh\n{body}\n")
        file.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_only_what_the_loader_does_not_find_is_missing(libraries: ModuleType) -> None:
    assert libraries.missing_libraries() == [ABSENT]


def test_a_user_without_free_sudo_gets_the_one_line(
    libraries: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(tmp_path, monkeypatch, apt_get=f"echo ran > {tmp_path}/ran", sudo="exit 1")
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(libraries.MissingLibrariesError) as refusal:
        libraries.ensure()
    assert str(refusal.value).splitlines()[-1].strip() == "sudo apt-get install -y libabsent7"
    assert ABSENT in str(refusal.value)
    assert not (tmp_path / "ran").exists()


def test_with_free_sudo_apt_runs_and_a_library_that_stays_away_is_an_error(
    libraries: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(
        tmp_path,
        monkeypatch,
        sudo='shift; [ "$1" = true ] && exit 0; exec "$@"',
        env='shift; exec "$@"',
        apt_get=f'echo "$@" >> {tmp_path}/ran',
    )
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(libraries.MissingLibrariesError, match="left these shared libraries missing"):
        libraries.ensure()
    assert (tmp_path / "ran").read_text().splitlines() == [
        "-q update",
        "-q install -y --no-install-recommends libabsent7",
    ]


def test_where_there_is_no_apt_the_libraries_are_named(
    libraries: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put_on_path(tmp_path, monkeypatch)
    with pytest.raises(libraries.MissingLibrariesError) as refusal:
        libraries.ensure()
    assert str(refusal.value) == f"these shared libraries are missing: {ABSENT}"


def test_a_complete_system_is_left_alone(
    libraries: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(libraries, "DEBIAN_PACKAGES", {"libc.so.6": "libc6"})
    put_on_path(tmp_path, monkeypatch, apt_get=f"echo ran > {tmp_path}/ran")
    libraries.ensure()
    assert not (tmp_path / "ran").exists()
