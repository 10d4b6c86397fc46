"""Optional dependencies: using a feature without its package raises an error with the install command."""

from __future__ import annotations

import ctypes
import json
import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bestman_bt.errors import MissingExtraError

PACKAGE_OF_EXTRA = {
    "mujoco": "mujoco",
    "objects": "coacd",
    "open3d": "open3d",
    "ray": "ray",
    "rerun": "rerun",
    "sim": "pybullet",
    "slurm": "submitit",
    "video": "av",
}
"""Extra → the import name of its essential package."""
EXTRA_OF_SIMULATOR = {"mujoco": "mujoco", "pybullet": "sim"}
"""Simulation driver → the extra that it needs."""
PYBULLET_HAS_WHEELS = sys.version_info < (3, 12)


def is_installed(extra: str) -> bool:
    """Return whether the package of an extra is installed, without importing it."""
    return find_spec(PACKAGE_OF_EXTRA[extra]) is not None


_PYBULLET = is_installed("sim") or (PYBULLET_HAS_WHEELS and not is_installed("mujoco"))
DEFAULT_SIMULATOR = "pybullet" if _PYBULLET else "mujoco"
"""The default driver: PyBullet if it is installed, or if it is available and MuJoCo is not installed; else MuJoCo."""


def install_command(extra: str) -> str:
    """Return the command that installs an extra from the source of this installation: an index, a file or a
    checkout.
    """
    # They take longer than what most commands do.
    from importlib import metadata
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        origin = json.loads(metadata.distribution("bestman-bt").read_text("direct_url.json") or "{}")
    except metadata.PackageNotFoundError:
        origin = {}
    url, requirement = str(origin.get("url", "")), f"bestman-bt[{extra}]"
    if not url:
        return f"pip install '{requirement}'"
    if origin.get("dir_info", {}).get("editable"):
        return f"pip install -e '{url2pathname(urlsplit(url).path)}[{extra}]'"
    return f"pip install '{requirement} @ {url}'"


def missing_extra(what: str, extra: str) -> MissingExtraError:
    """Return an error stating that ``what`` needs ``extra``."""
    package = PACKAGE_OF_EXTRA[extra]
    if extra == "sim" and not PYBULLET_HAS_WHEELS:
        why = f"which has wheels for Python 3.11 only; this is Python {sys.version_info[0]}.{sys.version_info[1]}"
        return MissingExtraError(f"{what} needs the package {package!r}, {why}", name=package)
    return MissingExtraError(f"{what} needs the package {package!r}: {install_command(extra)}", name=package)


def require_extra(what: str, extra: str) -> None:
    """Raise MissingExtraError if a package of ``extra``, which ``what`` needs, is not installed."""
    if not is_installed(extra):
        raise missing_extra(what, extra)


@cache
def open3d() -> Any:
    """Import and return open3d, which takes seconds.

    Its wheels expect the system's libusb; that of the extra is loaded first, under the file name that they expect.
    Raises MissingExtraError if open3d or one of its system libraries is missing.
    """
    require_extra("this", "open3d")
    try:
        ctypes.CDLL(str(import_module("libusb_package").get_library_path()), mode=ctypes.RTLD_GLOBAL)
        return import_module("open3d")
    except (ImportError, OSError) as error:
        libraries = "sudo apt-get install -y libegl1 libgl1 libgomp1 libudev1 libx11-6"
        raise MissingExtraError(f"open3d cannot be loaded: {error}. On Debian this may help: {libraries}") from error


def hiding_files() -> list[str]:
    """Return the files beside the script that hide a package of bestman-bt."""
    beside = Path(sys.path[0] if sys.path else "").resolve()
    names = ("behaviours", "hal") if beside != Path(__file__).parents[1] else ()
    return [str(beside / f"{name}.py") for name in names if (beside / f"{name}.py").is_file()]


def hides(file: str) -> str:
    """Return the error message for a ``file`` that hides a package."""
    return f"{file} hides the package '{Path(file).stem}' of bestman-bt, which robots and skills need: rename that file"


def refuse_hidden_packages() -> None:
    """Raise ImportError if a file beside the script hides a package of bestman-bt."""
    for file in hiding_files():
        raise ImportError(hides(file), path=file)
