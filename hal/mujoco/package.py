"""The package mujoco (extra ``mujoco``), imported here alone; without it, every use of it says what to install."""

from __future__ import annotations

import os
import sys
from typing import Any

from bestman_bt.extras import missing_extra

__all__ = ["mujoco"]


class _Missing:
    """In place of the package."""

    def __getattr__(self, name: str) -> Any:
        raise missing_extra("the engine MuJoCo", "mujoco")


if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("MUJOCO_GL", "egl")  # without a display, MuJoCo's own choice is a window system
try:
    import mujoco
except ModuleNotFoundError:
    mujoco = _Missing()
