"""Blender as a Python module in a virtual environment of its own, made when a user asks for it.

Blender is GPL-3.0; nothing of this package imports it: it runs as a program of its own, with a script and a job file.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from bestman_bt.errors import InputError
from bestman_bt.visualization.errors import VisualizationError

BPY = "bpy==5.0.1"
PYTHON = (3, 11)
"""The Python that this Blender is built for."""
SIZE = "about 1 GB"
INSTALL_COMMAND = "bestman-bt render --install-blender"


class BlenderError(VisualizationError, InputError):
    """Blender is not there, cannot be installed, or has not painted what it should."""


def environment_folder() -> Path:
    """``$XDG_DATA_HOME/bestman-bt/blender``, or ``~/.local/share/bestman-bt/blender``."""
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "bestman-bt" / "blender"


def blender_python() -> Path:
    """The Python that has Blender: BESTMAN_BT_BLENDER_PYTHON, or that of the installation; else BlenderError."""
    given = os.environ.get("BESTMAN_BT_BLENDER_PYTHON")
    python = Path(given) if given else environment_folder() / "bin" / "python"
    if python.is_file():
        return python
    if given:
        raise BlenderError(f"BESTMAN_BT_BLENDER_PYTHON names {given}, and there is no such file")
    raise BlenderError(f"Blender is not installed for bestman-bt; {SIZE}, GPL-3.0, once: {INSTALL_COMMAND}")


def install_blender(tell: Callable[[str], None]) -> Path:
    """Make the environment and install Blender into it from the Python package index; returns its Python.

    Raises BlenderError; nothing is left behind then.
    """
    folder = environment_folder()
    python = folder / "bin" / "python"
    steps = {
        f"an environment in {folder}": [_base_python(), "-m", "venv", "--clear", str(folder)],
        f"{BPY}, {SIZE}": [str(python), "-m", "pip", "install", "--quiet", BPY],
        "a first start": [str(python), "-I", "-c", "import bpy; print(bpy.app.version_string)"],
    }
    folder.parent.mkdir(parents=True, exist_ok=True)
    for what, command in steps.items():
        tell(what)
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            shutil.rmtree(folder, ignore_errors=True)
            raise BlenderError(f"{what} failed:\n{last_lines(done.stderr or done.stdout)}")
    return python


def last_lines(text: str, count: int = 12) -> str:
    """The end of what a program said."""
    return "\n".join(text.strip().splitlines()[-count:])


def _base_python() -> str:
    """A Python of the version that Blender is built for."""
    if sys.version_info[:2] == PYTHON:
        return sys.executable
    name = f"python{PYTHON[0]}.{PYTHON[1]}"
    found = shutil.which(name)
    if found is None:
        raise BlenderError(f"{BPY} needs {name}, and it is not in PATH; this is Python {sys.version.split()[0]}")
    return found
