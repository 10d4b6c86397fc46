"""The one door to pybullet: every call passes here, and what an honest run must not do is counted."""

from __future__ import annotations

import functools
import sys
from collections import Counter
from collections.abc import Callable
from enum import Enum
from typing import Any

from hal.api import NotConnectedError, RobotError
from hal.pybullet.package import pybullet

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

SIMULATION = "hal.pybullet."
"""What the names of the simulation's modules begin with."""

# Taken once, so that the guard on the module (raw_call_guard) does not see the calls that pass here.
_FUNCTIONS: dict[str, Callable[..., Any]] = {name: value for name, value in vars(pybullet).items() if callable(value)}


class ReadPurpose(Enum):
    """Why a part of the simulation reads poses that no robot could know."""

    SENSOR = "sensor"  # to render an image or cast a scan
    MONITOR = "monitor"  # the audit itself
    EVALUATION = "evaluation"
    RECORDING = "recording"
    WALKER = "walker"  # what people see of the robot
    SCRIPT = "script"  # what somebody who disturbs sees


class SimulationError(RobotError):
    """The physics engine refused something, or a body was asked for that is not there."""


class PhysicsClient:
    """One physics server of its own; pybullet's functions are its attributes, without ``physicsClientId``.

    After ``seal`` (the scene is built), ``counts`` holds resets, constraints, tampering and reads of ground truth.
    Joint states of the robot are encoders and free. Every other pose is ground truth: read it through ``reader``.
    Until ``close_truth``, the parts of the simulation and the evaluation take what they need without being counted.
    """

    def __init__(self) -> None:
        self._id = -1
        self._sealed = False
        self._closed = False
        self._robot: int | None = None
        self._bound: set[str] = set()
        self.counts: Counter[str] = Counter()
        self.calls: Counter[str] = Counter()

    @property
    def id(self) -> int:
        """The physics server's id."""
        return self._id

    @property
    def connected(self) -> bool:
        """Whether a physics server is there."""
        return self._id >= 0

    @property
    def sealed(self) -> bool:
        """Whether the scene is built and honesty is counted."""
        return self._sealed

    def connect(self, gui: bool = False) -> None:
        """Start a physics server; SimulationError if there is none to be had, MissingExtraError without pybullet."""
        mode = pybullet.GUI if gui else pybullet.DIRECT
        self._id = _FUNCTIONS["connect"](mode)
        if self._id < 0:
            raise SimulationError(f"pybullet gave no {'GUI' if gui else 'DIRECT'} physics server")

    def disconnect(self) -> None:
        """Close the physics server; idempotent."""
        if self.connected:
            _FUNCTIONS["disconnect"](physicsClientId=self._id)
        self._id = -1
        self._unbind()

    def seal(self, robot: int) -> None:
        """The scene is built: count from now on. ``robot``: the body whose joints are encoders."""
        self._robot = robot
        self._sealed = True
        self._unbind()

    def close_truth(self) -> None:
        """All who may look and act past the Robotics API have their functions: what is taken from now on is counted."""
        self._closed = True

    @property
    def truth_closed(self) -> bool:
        """Whether ``close_truth`` was called."""
        return self._closed

    def reader(self, purpose: ReadPurpose) -> Reader:
        """A view of ground truth for the module that calls this; its reads are counted if it opens after
        ``close_truth``.
        """
        owner: str = sys._getframe(1).f_globals.get("__name__", "")
        return Reader(self, purpose, owner, trusted=not self._closed)

    def note(self, name: str, arguments: tuple[Any, ...] = (), keywords: dict[str, Any] | None = None) -> None:
        """Count a call of a guarded function, if it is one that an honest run does not make."""
        if not self._sealed:
            return
        if name in RESETS:
            kind = "resets"
        elif name in CONSTRAINTS:
            kind = "constraints"
        elif name in TAMPERING:
            kind = "tampering"
        elif name in JOINT_MOTORS and self._body(arguments, keywords or {}) != self._robot:
            kind = "tampering"  # doors and drawers have no motors, and those of walkers are no skill's
        elif name in TRUTH_READS or (name in ENCODER_READS and self._body(arguments, keywords or {}) != self._robot):
            kind = "truth_reads"
        else:
            return
        self.counts[kind] += 1
        self.calls[name] += 1

    def note_tampering(self, name: str) -> None:
        """Count a call past this client that commands motors or steps physics."""
        if self._sealed:
            self.counts["tampering"] += 1
            self.calls[name] += 1

    def note_truth_read(self, what: str) -> None:
        """Count a look at the truth that needs no call of pybullet, after ``close_truth``."""
        if self._closed:
            self.counts["truth_reads"] += 1
            self.calls[what] += 1

    def function(self, name: str) -> Callable[..., Any]:
        """Pybullet's function ``name``, bound to this server; its calls are free if it is taken before ``close_truth``.

        For parts that act on the world by what they are: a latch, a suction cup.
        """
        if not self._closed:
            return self._bind(name)
        counted: Callable[..., Any] = getattr(self, name)
        return counted

    def _bind(self, name: str) -> Callable[..., Any]:
        if not self.connected:
            raise NotConnectedError("the simulation is not connected; call connect() first")
        return functools.partial(_FUNCTIONS[name], physicsClientId=self._id)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_") or name not in _FUNCTIONS:
            raise AttributeError(f"pybullet has no function {name!r}")
        bound = self._bind(name)
        if self._sealed and name in GUARDED:
            bound = self._counted(name, bound)
        self._bound.add(name)
        self.__dict__[name] = bound  # the next call finds it without coming here
        return bound

    def _unbind(self) -> None:
        for name in self._bound:
            del self.__dict__[name]
        self._bound.clear()

    def _counted(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **keywords: Any) -> Any:
            self.note(name, arguments, keywords)
            return call(*arguments, **keywords)

        return counted

    @staticmethod
    def _body(arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        return arguments[0] if arguments else keywords.get("bodyUniqueId")


class Reader:
    """Reads of ground truth for one purpose; the functions of TRUTH_READS and ENCODER_READS are its attributes.

    They are free for the module ``owner`` that opened it, and for the simulation that it is handed to. Who finds one
    in an object of somebody else's and reads with it is counted.
    """

    def __init__(self, client: PhysicsClient, purpose: ReadPurpose, owner: str, trusted: bool) -> None:
        self._client, self._owner = client, owner
        self._free: dict[str, Callable[..., Any]] = {}
        self.purpose = purpose
        self.trusted = trusted

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in TRUTH_READS and name not in ENCODER_READS:
            raise AttributeError(f"a reader does not offer {name!r}")
        asks: str = sys._getframe(1).f_globals.get("__name__", "")
        if not self.trusted or not (asks == self._owner or asks.startswith(SIMULATION)):
            counted: Callable[..., Any] = getattr(self._client, name)
            return counted
        if name not in self._free:
            self._free[name] = self._client._bind(name)
        return self._free[name]


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
