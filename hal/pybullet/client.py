"""The one door to pybullet: every call passes here, and what an honest run must not do is counted."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from hal.api import NotConnectedError
from hal.pybullet.package import pybullet
from hal.simulation import Ledger, SimulationError

RESETS = frozenset(
    {
        "resetBasePositionAndOrientation",
        "resetBaseVelocity",
        "resetJointState",
        "resetJointStateMultiDof",
        "resetJointStatesMultiDof",
        "resetMeshData",
        "resetSimulation",
        "restoreState",
    }
)
CONSTRAINTS = frozenset({"createConstraint", "createSoftBodyAnchor"})
TAMPERING = frozenset(
    {
        "applyExternalForce",
        "applyExternalTorque",
        "changeConstraint",
        "changeDynamics",
        "createMultiBody",
        "loadBullet",
        "loadMJCF",
        "loadSDF",
        "loadSoftBody",
        "loadURDF",
        "removeBody",
        "removeConstraint",
        "setCollisionFilterGroupMask",
        "setCollisionFilterPair",
        "setGravity",
        "setPhysicsEngineParameter",
        "setTimeStep",
    }
)
TRUTH_READS = frozenset(
    {
        "getAABB",
        "getBasePositionAndOrientation",
        "getBaseVelocity",
        "getCameraImage",
        "getClosestPoints",
        "getContactPoints",
        "getLinkState",
        "getLinkStates",
        "getOverlappingObjects",
        "rayTest",
        "rayTestBatch",
    }
)
ENCODER_READS = frozenset({"getJointState", "getJointStates", "getJointStateMultiDof", "getJointStatesMultiDof"})
JOINT_MOTORS = frozenset(
    {
        "setJointMotorControl",
        "setJointMotorControl2",
        "setJointMotorControlArray",
        "setJointMotorControlMultiDof",
        "setJointMotorControlMultiDofArray",
    }
)
GUARDED = RESETS | CONSTRAINTS | TAMPERING | TRUTH_READS | ENCODER_READS | JOINT_MOTORS

# Taken once, so that the guard on the module (raw_call_guard) does not see the calls that pass here.
_FUNCTIONS: dict[str, Callable[..., Any]] = {name: value for name, value in vars(pybullet).items() if callable(value)}


class PhysicsClient:
    """One physics server of its own; pybullet's functions are its attributes, without ``physicsClientId``.

    Once the ledger is sealed (the scene is built), resets, constraints, tampering and reads of ground truth are
    counted in it. Joint states of ``robot``, a body, are encoders and free; every other pose is ground truth.
    """

    def __init__(self, ledger: Ledger | None = None) -> None:
        self.ledger = Ledger() if ledger is None else ledger
        self.id = -1
        self.robot: int | None = None
        self._bound: set[str] = set()
        self._counts = True

    def connect(self, gui: bool = False) -> None:
        """Start a physics server; SimulationError if there is none to be had, MissingExtraError without pybullet."""
        mode = pybullet.GUI if gui else pybullet.DIRECT
        self.id = _FUNCTIONS["connect"](mode)
        if self.id < 0:
            raise SimulationError(f"pybullet gave no {'GUI' if gui else 'DIRECT'} physics server")

    def disconnect(self) -> None:
        """Close the physics server; idempotent."""
        if self.id >= 0:
            _FUNCTIONS["disconnect"](physicsClientId=self.id)
        self.id = -1
        for name in self._bound:
            del self.__dict__[name]
        self._bound.clear()

    def free(self) -> PhysicsClient:
        """Another client of this server, whose calls are not counted if it is taken before the truth is closed."""
        if self.ledger.truth_closed:
            return self
        client = PhysicsClient(self.ledger)
        client.id, client._counts = self.id, False
        return client

    def note(self, name: str, arguments: tuple[Any, ...] = (), keywords: dict[str, Any] | None = None) -> None:
        """Count a call of a guarded function, if it is one that an honest run does not make."""
        body = arguments[0] if arguments else (keywords or {}).get("bodyUniqueId")
        if name in RESETS:
            self.ledger.note("resets", name)
        elif name in CONSTRAINTS:
            self.ledger.note("constraints", name)
        elif name in TAMPERING or (name in JOINT_MOTORS and body != self.robot):
            self.ledger.note("tampering", name)  # doors and drawers have no motors, and those of walkers are no skill's
        elif name in TRUTH_READS or (name in ENCODER_READS and body != self.robot):
            self.ledger.note("truth_reads", name)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_") or name not in _FUNCTIONS:
            raise AttributeError(f"pybullet has no function {name!r}")
        if self.id < 0:
            raise NotConnectedError("the simulation is not connected; call connect() first")
        bound: Callable[..., Any] = functools.partial(_FUNCTIONS[name], physicsClientId=self.id)
        if self._counts and name in GUARDED:
            bound = self._counted(name, bound)
        self._bound.add(name)
        self.__dict__[name] = bound  # the next call finds it without coming here
        return bound

    def _counted(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **keywords: Any) -> Any:
            self.note(name, arguments, keywords)
            return call(*arguments, **keywords)

        return counted


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
                client.ledger.note("tampering", name)
            else:
                client.note(name, arguments, keywords)
        return original(*arguments, **keywords)

    return guarded


# Once and for good, when this package is imported: so what a plug-in takes from the module before a robot connects
# ("from pybullet import resetJointState") is guarded as well.
for _name in GUARDED | MOTORS:
    if _name in vars(pybullet):
        setattr(pybullet, _name, _guard(_name, getattr(pybullet, _name)))
