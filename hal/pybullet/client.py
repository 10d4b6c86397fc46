"""The only access to pybullet: all calls pass here, and calls forbidden in an audited run are counted."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from typing import Any

from hal.api import NotConnectedError
from hal.pybullet.package import pybullet
from hal.simulation.audit_record import CallCounter
from hal.simulation.bodies import SimulationError

ALLOWED = frozenset(
    {
        *("getAPIVersion", "getConnectionInfo", "isConnected", "isNumpyEnabled", "connect", "error"),
        *("getNumBodies", "getBodyUniqueId", "getBodyInfo", "getNumJoints", "getJointInfo", "computeDofCount"),
        *("computeViewMatrix", "computeViewMatrixFromYawPitchRoll", "computeProjectionMatrix"),
        *("computeProjectionMatrixFOV", "getQuaternionFromEuler", "getEulerFromQuaternion", "multiplyTransforms"),
        *("invertTransform", "getMatrixFromQuaternion", "getQuaternionSlerp", "getQuaternionFromAxisAngle"),
        *("getAxisAngleFromQuaternion", "getDifferenceQuaternion", "getAxisDifferenceQuaternion"),
        *("calculateVelocityQuaternion", "rotateVector", "calculateInverseDynamics", "calculateJacobian"),
        *("calculateMassMatrix", "calculateInverseKinematics", "calculateInverseKinematics2"),
        *("getPhysicsEngineParameters", "setAdditionalSearchPath", "vhacd", "submitProfileTiming"),
        *("getKeyboardEvents", "getMouseEvents", "getVREvents", "setVRCameraState"),
        *("addUserDebugLine", "addUserDebugPoints", "addUserDebugText", "addUserDebugParameter"),
        *("readUserDebugParameter", "removeUserDebugItem", "removeAllUserDebugItems", "removeAllUserParameters"),
        *("getDebugVisualizerCamera", "configureDebugVisualizer", "resetDebugVisualizerCamera"),
    }
)
"""Functions that any code may call during a run: mathematics, descriptions without poses, drawings in the window. Every
other function is counted."""
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
READS = ("get", "ray", "save", "render", "startStateLogging", "performCollisionDetection")
"""Prefixes of functions that read the state of the world."""
OWN = frozenset(
    {"getJointState", "getJointStates", "getJointStateMultiDof", "getJointStatesMultiDof", "getDynamicsInfo"}
)
"""Those of these functions that are allowed for the robot's own body: its encoders and its masses."""


def kind_of(name: str) -> str:
    """Return the category under which a function is counted."""
    if name in RESETS:
        return "resets"
    if name in CONSTRAINTS:
        return "constraints"
    return "truth_reads" if name.startswith(READS) else "tampering"


UNGUARDED_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: call for name, call in vars(pybullet).items() if callable(call)
}
"""Imported once, so that the guard on the module (raw_call_guard) does not count the calls made here."""


class PhysicsClient:
    """A separate physics server; pybullet's functions are its attributes, without ``physicsClientId``.

    After the call counter is sealed (the scene is built), it counts every call that is not ``ALLOWED``: resets,
    constraints, tampering (including motors of the robot, which are commanded through the Robotics API) and reads of
    ground truth. Joint states of the body ``robot`` are encoders and not counted; all other poses are ground truth.
    """

    def __init__(self, ledger: CallCounter | None = None) -> None:
        self.ledger = CallCounter() if ledger is None else ledger
        self.id = -1
        self.robot: int | None = None
        self._bound: set[str] = set()
        self._counts = True

    def connect(self, gui: bool = False) -> None:
        """Start a physics server.

        Raises SimulationError if it cannot be started, MissingExtraError without pybullet.
        """
        mode = pybullet.GUI if gui else pybullet.DIRECT
        self.id = UNGUARDED_FUNCTIONS["connect"](mode)
        if self.id < 0:
            raise SimulationError(f"pybullet gave no {'GUI' if gui else 'DIRECT'} physics server")

    def disconnect(self) -> None:
        """Close the physics server; idempotent."""
        if self.id >= 0:
            UNGUARDED_FUNCTIONS["disconnect"](physicsClientId=self.id)
        self.id = -1
        for name in self._bound:
            del self.__dict__[name]
        self._bound.clear()

    def free(self) -> PhysicsClient:
        """Return another client of this server, whose calls are not counted if it is created before ``close_truth``."""
        if self.ledger.truth_closed:
            return self
        client = PhysicsClient(self.ledger)
        client.id, client._counts = self.id, False
        return client

    def note(self, name: str, arguments: tuple[Any, ...] = (), keywords: dict[str, Any] | None = None) -> None:
        """Count a call if it is not allowed in an audited run."""
        body = arguments[0] if arguments else (keywords or {}).get("bodyUniqueId")
        if name not in ALLOWED and not (name in OWN and body == self.robot):
            self.ledger.note(kind_of(name), name)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_") or name not in UNGUARDED_FUNCTIONS:
            raise AttributeError(f"pybullet has no function {name!r}")
        if self.id < 0:
            raise NotConnectedError("the simulation is not connected; call connect() first")
        bound: Callable[..., Any] = functools.partial(UNGUARDED_FUNCTIONS[name], physicsClientId=self.id)
        if self._counts and name not in ALLOWED:
            bound = self._counted(name, bound)
        self._bound.add(name)
        self.__dict__[name] = bound  # the next call finds it without coming here
        return bound

    def _counted(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **keywords: Any) -> Any:
            self.note(name, arguments, keywords)
            return call(*arguments, **keywords)

        return counted


_watched: dict[int, PhysicsClient] = {}


class RawCallGuard:
    """Counts the calls, from ``install`` to ``remove``, that do not come from the robot's client.

    It detects calls that name its physics server, by keyword or as last argument, or by default (server 0). Effects of
    calls that it cannot detect (functions imported before this package) are found by the monitors.
    """

    def __init__(self, client: PhysicsClient) -> None:
        self._client, self._server = client, client.id

    def install(self) -> None:
        """Start to count calls; idempotent."""
        _watched[self._server] = self._client

    def remove(self) -> None:
        """Stop counting; idempotent."""
        _watched.pop(self._server, None)


def _most_arguments(function: Callable[..., Any]) -> int:
    """Return how many arguments a function takes, by its own complaint; the last one is the physics server."""
    try:
        function(*[None] * 99)
    except Exception as error:  # noqa: BLE001 - of whatever type: nothing is called with so many
        found = re.search(r"at most (\d+) argument", str(error))
        return int(found[1]) if found else 0
    return 0


def _guard(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
    most = _most_arguments(original)

    def guarded(*arguments: Any, **keywords: Any) -> Any:
        server = arguments[-1] if most and len(arguments) == most else keywords.get("physicsClientId", 0)
        client = _watched.get(server) if isinstance(server, int) else None
        if client is not None:
            client.note(name, arguments, keywords)
        return original(*arguments, **keywords)

    return guarded


# Once and for good, when this package is imported: so what a plug-in takes from the module before a robot connects
# ("from pybullet import resetJointState") is guarded as well.
for _name, _function in UNGUARDED_FUNCTIONS.items():
    if _name not in ALLOWED and not isinstance(_function, type):
        setattr(pybullet, _name, _guard(_name, _function))
