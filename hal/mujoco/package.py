"""The package mujoco (extra ``mujoco``), imported only here; without it, any use raises an error with the install
command."""

from __future__ import annotations

from typing import Any

from bestman_bt.extras import missing_extra

__all__ = ["mujoco"]


class _Missing:
    """In place of the package."""

    def __getattr__(self, name: str) -> Any:
        raise missing_extra("simulation", "mujoco")


try:
    import mujoco
except ModuleNotFoundError:
    mujoco = _Missing()
else:
    # By default, warnings go to a file in the working folder; the engine looks at their numbers after each step.
    mujoco.set_mju_user_warning(lambda text: None)
