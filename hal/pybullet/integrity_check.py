"""Watches what an honest run never changes: constraints, masses, frictions, gravity, the place of fixed bodies."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from hal.pybullet.audit_record import Finding
from hal.pybullet.client import PhysicsClient, Reader
from hal.pybullet.simulation import Simulation

FIXED_BODY_MOVED = 1e-4
FRICTIONS = (1, 7)
"""Where lateral and spinning friction are in what pybullet tells of a body."""
ENGINE_KEYS = ("fixedTimeStep", "gravityAccelerationX", "gravityAccelerationY", "gravityAccelerationZ")


class IntegrityCheck:
    """Compares with what was there when the scene was built."""

    def __init__(self, simulation: Simulation, client: PhysicsClient, reader: Reader) -> None:
        built = simulation.built
        self._client, self._reader = client, reader
        self._objects = built.objects
        self._fixed = {**built.walls, **built.furniture, "floor": built.floor}
        self._names = {built.robot: "robot", **built.body_names}
        self._constraints = built.constraints
        self._engine = self._engine_state()
        self._bodies = self._body_states()
        self._places = {name: self._place(body) for name, body in self._fixed.items()}
        self._body_count = client.getNumBodies()
        self.hidden_constraints: list[Finding] = []
        self.changes: list[Finding] = []
        self.jumps: list[Finding] = []

    def watch_constraints(self, stamp: float) -> None:
        """Cheap: at every look."""
        count = self._client.getNumConstraints()
        if count != self._constraints:
            self.hidden_constraints.append(Finding(stamp, f"there are {count} constraints, {self._constraints} before"))
            self._constraints = count

    def watch_everything(self, stamp: float, slippery: Collection[str] = ()) -> None:
        """Once in a while, and at the end; ``slippery``: objects that may be without friction, and nothing else."""
        self.watch_constraints(stamp)
        engine, bodies = self._engine_state(), self._body_states()
        for name in slippery:
            base = (self._objects[name], -1)
            bodies[base] = _with_friction(bodies[base], self._bodies[base])
        for key in engine:
            if engine[key] != self._engine[key]:
                self.changes.append(Finding(stamp, f"{key} changed from {self._engine[key]} to {engine[key]}"))
        for (body, link), state in bodies.items():
            if state != self._bodies.get((body, link)):
                name = self._names.get(body, f"body {body}")
                self.changes.append(Finding(stamp, f"mass, friction or contact values of {name}, link {link} changed"))
        count = self._client.getNumBodies()
        if count != self._body_count:
            self.changes.append(Finding(stamp, f"there are {count} bodies, {self._body_count} before"))
        self._engine, self._bodies, self._body_count = engine, bodies, count
        for name, body in self._fixed.items():
            place = self._place(body)
            if math.dist(place, self._places[name]) > FIXED_BODY_MOVED:
                self.jumps.append(Finding(stamp, f"{name}, which is fixed, has moved"))
                self._places[name] = place

    def _engine_state(self) -> dict[str, Any]:
        values = self._client.getPhysicsEngineParameters()
        return {key: values[key] for key in ENGINE_KEYS}

    def _body_states(self) -> dict[tuple[int, int], tuple[Any, ...]]:
        return {
            (body, link): self._client.getDynamicsInfo(body, link)
            for body in self._names
            for link in range(-1, self._client.getNumJoints(body))
        }

    def _place(self, body: int) -> tuple[float, ...]:
        position, quaternion = self._reader.getBasePositionAndOrientation(body)
        return (*position, *quaternion)


def _with_friction(state: tuple[Any, ...], before: tuple[Any, ...]) -> tuple[Any, ...]:
    """The state with the friction that it had before, where it has none now."""
    return tuple(before[index] if index in FRICTIONS and value == 0.0 else value for index, value in enumerate(state))
