"""Shared libraries that the locked wheels load and that pip cannot bring; installs or names the Debian packages.

The list is what ``ldd`` reports over every shared object of the environment and that a minimal Debian lacks.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys

DEBIAN_PACKAGES = {
    "libgomp.so.1": "libgomp1",
    "libstdc++.so.6": "libstdc++6",
    "libz.so.1": "zlib1g",
}


class MissingLibrariesError(Exception):
    """Libraries that are missing and that this user cannot install unasked; the text is for the user."""


def missing_libraries() -> list[str]:
    """Names of the needed libraries that the dynamic loader does not find."""
    return [name for name in DEBIAN_PACKAGES if not _loads(name)]


def debian_line(libraries: list[str]) -> str:
    """The one command that brings ``libraries`` on Debian."""
    packages = sorted(DEBIAN_PACKAGES[name] for name in libraries)
    return f"sudo apt-get install -y {' '.join(packages)}"


def ensure() -> None:
    """Install what is missing where that needs no password, else raise MissingLibrariesError."""
    missing = missing_libraries()
    if not missing:
        return
    if shutil.which("apt-get") is None:
        raise MissingLibrariesError(f"these shared libraries are missing: {', '.join(missing)}")
    become_root = _become_root()
    if become_root is None:
        raise MissingLibrariesError(
            f"these shared libraries are missing: {', '.join(missing)}. This brings them:\n    {debian_line(missing)}"
        )
    _install(missing, become_root)


def _install(missing: list[str], become_root: list[str]) -> None:
    packages = sorted(DEBIAN_PACKAGES[name] for name in missing)
    print(f"Installing Debian packages: {' '.join(packages)}", flush=True)
    apt = [*become_root, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-q"]
    updated = subprocess.run([*apt, "update"], stdout=subprocess.DEVNULL, check=False)
    install = [*apt, "install", "-y", "--no-install-recommends", *packages]
    installed = subprocess.run(install, stdout=subprocess.DEVNULL, check=False)
    still_missing = missing_libraries()
    if still_missing:
        raise MissingLibrariesError(
            f"apt-get (update: exit {updated.returncode}, install: exit {installed.returncode}) left these shared"
            f" libraries missing: {', '.join(still_missing)}. To see why:\n    {debian_line(still_missing)}"
        )


def _become_root() -> list[str] | None:
    """Command prefix that makes a command run as root without a question, or None."""
    if os.geteuid() == 0:
        return []
    if (
        shutil.which("sudo")
        and subprocess.run(["sudo", "-n", "true"], capture_output=True, check=False).returncode == 0
    ):
        return ["sudo", "-n"]
    return None


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    try:
        ensure()
    except MissingLibrariesError as error:
        sys.exit(f"error: {error}")
