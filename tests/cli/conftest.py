from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bestman_bt.cli.main import main
from tests.cli.command_line import Answer


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def own_sockets(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Executors of these tests are apart from anybody's robots: ``stop`` would reach those too."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))


@pytest.fixture
def bestman_bt(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Answer]:
    """The command in this process: ``bestman_bt("run", "fetch_cup")``."""

    def call(*arguments: object) -> Answer:
        monkeypatch.setattr(sys, "argv", ["bestman-bt", *(str(argument) for argument in arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        code = end.value.code
        assert isinstance(code, int)
        return Answer(code, *capsys.readouterr())

    return call
