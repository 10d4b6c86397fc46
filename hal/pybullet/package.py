"""The package pybullet (extra ``sim``). Robots that are real do without it, so it is missed when a world is started."""

from __future__ import annotations

from typing import Any

from bestman_bt.extras import missing_extra

__all__ = ["pybullet"]


class _Missing:
    """In place of the package: every use of it says what to install."""

    def __getattr__(self, name: str) -> Any:
        raise missing_extra("simulation", "sim")


try:
    import pybullet
except ModuleNotFoundError:
    pybullet = _Missing()
