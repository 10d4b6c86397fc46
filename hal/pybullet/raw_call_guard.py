"""Counts calls that go to the pybullet module directly, past the client, while a sealed simulation runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pybullet

from hal.pybullet.client import GUARDED, JOINT_MOTORS, PhysicsClient

MOTORS = JOINT_MOTORS | {"stepSimulation"}


class RawCallGuard:
    """Stands in front of pybullet's functions from ``install`` to ``remove``; each robot in a process has its own.

    It sees calls that name its physics server by ``physicsClientId``, or that mean it by default (server 0). What
    it cannot see (functions taken from the module earlier) the watchers see by its effects.
    """

    def __init__(self, client: PhysicsClient) -> None:
        self._client = client
        self._installed: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {}
        self._active = False

    def install(self) -> None:
        """Begin to count; idempotent."""
        if self._active:
            return
        self._active = True
        for name in GUARDED | MOTORS:
            original = getattr(pybullet, name, None)
            if original is not None:
                guard = self._guard(name, original)
                self._installed[name] = (guard, original)
                setattr(pybullet, name, guard)

    def remove(self) -> None:
        """Put the functions back; one that another guard stands before stays in the row and lets calls through."""
        self._active = False
        for name, (guard, original) in self._installed.items():
            if getattr(pybullet, name) is guard:
                setattr(pybullet, name, original)
        self._installed.clear()

    def _guard(self, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def guarded(*arguments: Any, **keywords: Any) -> Any:
            if self._active and keywords.get("physicsClientId", 0) == self._client.id:
                if name in MOTORS:
                    self._client.note_tampering(name)
                else:
                    self._client.note(name, arguments, keywords)
            return original(*arguments, **keywords)

        return guarded
