"""Counts calls that go to the pybullet module directly, past the client, while a sealed simulation runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hal.pybullet.client import GUARDED, JOINT_MOTORS, PhysicsClient
from hal.pybullet.package import pybullet

MOTORS = JOINT_MOTORS | {"stepSimulation"}

_watched: dict[int, PhysicsClient] = {}


class RawCallGuard:
    """Counts for one robot, from ``install`` to ``remove``, the calls that do not come from its client.

    It sees calls that name its physics server by ``physicsClientId``, or that mean it by default (server 0). What
    it cannot see (functions taken before this package was imported) the watchers see by its effects.
    """

    def __init__(self, client: PhysicsClient) -> None:
        self._client, self._server = client, client.id

    def install(self) -> None:
        """Begin to count; idempotent."""
        _watched[self._server] = self._client

    def remove(self) -> None:
        """Count no more; idempotent."""
        _watched.pop(self._server, None)


def _guard(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
    def guarded(*arguments: Any, **keywords: Any) -> Any:
        client = _watched.get(keywords.get("physicsClientId", 0))
        if client is not None:
            if name in MOTORS:
                client.note_tampering(name)
            else:
                client.note(name, arguments, keywords)
        return original(*arguments, **keywords)

    return guarded


# Once and for good, when this package is imported: so what a plug-in takes from the module before a robot connects
# ("from pybullet import resetJointState") is guarded as well.
for _name in GUARDED | MOTORS:
    if _name in vars(pybullet):
        setattr(pybullet, _name, _guard(_name, getattr(pybullet, _name)))
