"""Versions of the packages that a result depends on."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

PACKAGES = (
    "bestman-bt",
    "py-trees",
    "pybullet",
    "mujoco",
    "numpy",
    "scipy",
    "ompl",
    "pin",
    "toppra",
    "opencv-python-headless",
)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that affect a run."""
    return {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}


@cache
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
