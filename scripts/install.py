"""Makes ``.venv/`` with the locked packages and the project itself; does nothing where that is up to date.

Runs on a bare Python 3.11, 3.12 or 3.13, with which the environment is made. uv installs the lock (it is several times
faster than pip); pip does where uv cannot.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
import subprocess
import sys
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import system_libraries

CHECKOUT = Path(__file__).resolve().parents[1]
ENVIRONMENT = CHECKOUT / ".venv"
PYTHON = ENVIRONMENT / "bin" / "python"
LOCK = CHECKOUT / "requirements.lock"
STAMP = ENVIRONMENT / "installed.sha256"

LOADED = """
import toppra
import bestman_bt.cli.run_command, bestman_bt.evaluation.report.page, bestman_bt.evaluation.report.run_reader
from bestman_bt.runtime.plugins import node_registry
node_registry()
"""
"""Imports what the commands of every day import: nodes, trees, a simulated run, its report."""

UV_NAME_OF_PIP_OPTION = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "no-index": "UV_NO_INDEX",
    "trusted-host": "UV_INSECURE_HOST",
    "timeout": "UV_HTTP_TIMEOUT",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "cert": "SSL_CERT_FILE",
    "client-cert": "SSL_CLIENT_CERT",
    "proxy": "ALL_PROXY",
}
"""pip's options that say where packages come from, and the environment variables by which uv takes the same."""


def main() -> int:
    """Install; returns the exit code (2: a system library or an interpreter is missing)."""
    try:
        system_libraries.ensure()
    except system_libraries.MissingLibrariesError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    wanted = fingerprint()
    if is_current(wanted):
        return 0
    started = time.monotonic()
    print(f"Installing into {ENVIRONMENT.name}/ ...", flush=True)
    STAMP.unlink(missing_ok=True)
    if not PYTHON.exists() or not _runs_this_version(PYTHON):
        venv.create(ENVIRONMENT, with_pip=True, clear=ENVIRONMENT.exists())
    try:
        install_lock()
        with compiling():
            install_project()
        if sys.version_info >= (3, 12):  # PyBullet, which has no wheels for them, would bring the models of robots
            _run([str(ENVIRONMENT / "bin" / "bestman-bt"), "robot", "descriptions"])
    except subprocess.CalledProcessError as error:
        print(f"error: {' '.join(map(str, error.cmd))} ended with exit code {error.returncode}", file=sys.stderr)
        return 1
    STAMP.write_text(wanted)
    print(f"Installed in {time.monotonic() - started:.0f} s: .venv/bin/bestman-bt", flush=True)
    return 0


def fingerprint() -> str:
    """SHA-256 over everything that decides what the environment holds."""
    digest = hashlib.sha256()
    for file in (LOCK, CHECKOUT / "pyproject.toml", Path(__file__)):
        digest.update(file.read_bytes())
    digest.update(str(ENVIRONMENT).encode())
    return digest.hexdigest()


def is_current(wanted: str) -> bool:
    """True where the environment was completed with the fingerprint ``wanted`` and its interpreter still runs."""
    return STAMP.exists() and STAMP.read_text() == wanted and _runs_this_version(PYTHON)


def install_lock() -> None:
    """Install the lock, hashes checked, with uv, else with pip."""
    requirements = ["--require-hashes", "-r", str(LOCK)]
    try:
        _run([*_pip_install(), "--no-deps", "--require-hashes", "-r", _uv_requirement()])
        _run(
            [str(PYTHON), "-m", "uv", "pip", "install", "-q", "--python", str(PYTHON), *requirements], _uv_environment()
        )
    except subprocess.CalledProcessError:
        print("uv could not install the lock; trying pip, which takes longer ...", flush=True)
        _run([*_pip_install(), *requirements])


def install_project() -> None:
    """Install the checkout itself, editable, without a second resolution."""
    _run([*_pip_install(), "--no-deps", "--no-build-isolation", "--editable", str(CHECKOUT)])


@contextmanager
def compiling() -> Iterator[None]:
    """Beside the body, compile what the commands load, which uv, other than pip, leaves to their first run.

    That may not keep what it compiles (PYTHONDONTWRITEBYTECODE), so that every run would take seconds longer.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [str(PYTHON), "-c", LOADED]
    with subprocess.Popen(command, cwd=CHECKOUT, env=environment) as compiler:
        yield
        if compiler.wait():
            raise subprocess.CalledProcessError(compiler.returncode, command)


def uv_settings(pip_configuration: str, environment: dict[str, str]) -> dict[str, str]:
    """What uv must be told to find packages where pip would.

    ``pip_configuration``: the output of ``pip config list``. Variables that ``environment`` has already stay.
    """
    options: dict[str, str] = {}
    for section in ("global", "install", ":env:"):
        for line in pip_configuration.splitlines():
            key, _, value = line.partition("=")
            if key.startswith(f"{section}."):
                options[key.removeprefix(f"{section}.")] = str(ast.literal_eval(value))
    settings = {"UV_INDEX_STRATEGY": "unsafe-best-match"}  # as pip does; the hashes decide what is accepted
    for option, variable in UV_NAME_OF_PIP_OPTION.items():
        if option in options:
            separator = "," if option == "find-links" else " "
            settings[variable] = separator.join(options[option].split())
    return {name: value for name, value in settings.items() if name not in environment}


def _uv_environment() -> dict[str, str]:
    listed = subprocess.run([str(PYTHON), "-m", "pip", "config", "list"], capture_output=True, text=True, check=True)
    return {**os.environ, **uv_settings(listed.stdout, dict(os.environ))}


def _uv_requirement() -> str:
    """Path of a requirements file that holds the lock's entry for uv alone."""
    entry = re.search(r"^uv==.*(?:\n\s+--hash=.*)+", LOCK.read_text(), re.MULTILINE)
    if entry is None:
        raise LookupError(f"{LOCK.name} has no entry for uv; run make lock")
    file = ENVIRONMENT / "uv.txt"
    file.write_text(entry.group() + "\n")
    return str(file)


def _pip_install() -> list[str]:
    return [str(PYTHON), "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]


def _run(command: list[str], environment: dict[str, str] | None = None) -> None:
    subprocess.run(command, cwd=CHECKOUT, env=environment, check=True)


def _runs_this_version(python: Path) -> bool:
    probe = [str(python), "-c", f"import sys; sys.exit(sys.version_info[:2] != {sys.version_info[:2]})"]
    return python.exists() and subprocess.run(probe, check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main())
