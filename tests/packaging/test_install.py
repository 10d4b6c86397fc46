"""make install: clear refusals, and uv looks for packages where the user's pip does."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from shutil import copy
from types import ModuleType

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPTS = CHECKOUT / "scripts"


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(SCRIPTS))
    specification = importlib.util.spec_from_file_location("install", SCRIPTS / "install.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def run_install_sh(python: str, scripts: Path = SCRIPTS) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHON": python}
    command = ["sh", str(scripts / "install.sh")]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def interpreter(folder: Path, body: str) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "python"
    file.write_text(f"#!/bin/sh\n{body}\n")
    file.chmod(0o755)
    return str(file)


def test_a_missing_interpreter_is_named_and_nothing_starts() -> None:
    result = run_install_sh("python3.11-that-is-not-here")
    assert result.returncode == 2
    assert "python3.11-that-is-not-here was not found" in result.stderr
    assert result.stdout == ""


def test_another_python_version_is_refused(tmp_path: Path) -> None:
    result = run_install_sh(interpreter(tmp_path, '[ "$1" = --version ] && echo Python 3.9.2 && exit; exit 1'))
    assert result.returncode == 2
    assert "is Python 3.9.2; bestman-bt needs Python 3.11, 3.12 or 3.13" in result.stderr


def test_a_python_without_venv_is_refused(tmp_path: Path) -> None:
    result = run_install_sh(interpreter(tmp_path, 'case "$2" in *ensurepip*) exit 1;; esac'))
    assert result.returncode == 2
    assert "has no venv module" in result.stderr


def test_an_environment_keeps_its_python_unless_another_is_named(tmp_path: Path) -> None:
    scripts = tmp_path / "scripts"
    scripts.mkdir()
    copy(SCRIPTS / "install.sh", scripts)
    first, second = (
        interpreter(tmp_path / name, f'case "$1" in *install.py) echo by the {name};; esac')
        for name in ("first", "second")
    )
    interpreter(tmp_path / ".venv/bin", f"echo '{first}'")
    assert run_install_sh("", scripts).stdout == "by the first\n"
    assert run_install_sh(second, scripts).stdout == "by the second\n"
    interpreter(tmp_path / ".venv/bin", f"echo '{tmp_path / 'gone'}'")
    assert "gone" not in run_install_sh("", scripts).stderr


def test_uv_takes_its_places_from_the_configuration_that_pip_reports(
    install: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "pip.conf"
    file.write_text("[global]\nindex-url = https://from-file.example/simple\ncert = /etc/company.pem\n")
    monkeypatch.setenv("PIP_CONFIG_FILE", str(file))
    monkeypatch.setenv("PIP_INDEX_URL", "https://from-environment.example/simple")
    listing = [sys.executable, "-m", "pip", "config", "list"]
    listed = subprocess.run(listing, capture_output=True, text=True, check=True).stdout

    settings = install.uv_settings(listed, {})

    assert settings["UV_DEFAULT_INDEX"] == "https://from-environment.example/simple"
    assert settings["SSL_CERT_FILE"] == os.environ.get("PIP_CERT", "/etc/company.pem")


def test_uv_settings_of_the_user_are_kept(install: ModuleType) -> None:
    listed = "global.index-url='https://pip.example/simple'\n"
    assert "UV_DEFAULT_INDEX" not in install.uv_settings(listed, {"UV_DEFAULT_INDEX": "https://uv.example/simple"})


def test_several_extra_indexes_and_folders_reach_uv_in_its_own_notation(install: ModuleType) -> None:
    listed = "global.extra-index-url='https://a.example https://b.example'\nglobal.find-links='/wheels /more'\n"
    settings = install.uv_settings(listed, {})
    assert settings["UV_INDEX"] == "https://a.example https://b.example"
    assert settings["UV_FIND_LINKS"] == "/wheels,/more"


def test_an_environment_is_current_only_with_its_own_fingerprint(
    install: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stamp = tmp_path / "stamp"
    monkeypatch.setattr(install, "STAMP", stamp)
    monkeypatch.setattr(install, "PYTHON", Path(sys.executable))
    assert not install.is_current("a")
    stamp.write_text("a")
    assert install.is_current("a")
    assert not install.is_current("b")


def test_the_fingerprint_follows_the_lock(install: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = install.fingerprint()
    changed = tmp_path / "requirements.lock"
    changed.write_text("# another lock\n")
    monkeypatch.setattr(install, "LOCK", changed)
    assert install.fingerprint() != before
