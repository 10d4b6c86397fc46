"""Watches what an honest run never changes: constraints, masses, frictions, gravity, the place of fixed bodies."""

from __future__ import annotations

import math
from collections.abc import Collection

from hal.simulation.audit_record import Finding
from hal.simulation.guards import Reader
from hal.simulation.simulation import Simulation

FIXED_BODY_MOVED = 1e-4


class IntegrityCheck:
    """Compares with what was there when the scene was built."""

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built = simulation.built
        self._engine, self._reader = simulation.engine, reader
        self._fixed = {**built.walls, **built.furniture, "floor": built.floor}
        self._constraints = self._engine.constraint_count()
        self._constants = self._engine.constants()
        self._places = {name: self._place(body) for name, body in self._fixed.items()}
        self.hidden_constraints: list[Finding] = []
        self.changes: list[Finding] = []
        self.jumps: list[Finding] = []

    def watch_constraints(self, stamp: float) -> None:
        """Cheap: at every look."""
        count = self._engine.constraint_count()
        if count != self._constraints:
            self.hidden_constraints.append(Finding(stamp, f"there are {count} constraints, {self._constraints} before"))
            self._constraints = count

    def watch_everything(self, stamp: float, slippery: Collection[str] = ()) -> None:
        """Once in a while, and at the end; ``slippery``: objects that may be without friction, and nothing else."""
        self.watch_constraints(stamp)
        before, now = self._constants, dict(self._engine.constants())
        for key in (f"friction of {name}" for name in slippery):
            now[key] = tuple(old if new == 0.0 else new for new, old in zip(now[key], before[key], strict=True))
        for key, value in now.items():
            if value != before.get(key):
                self.changes.append(Finding(stamp, f"{key} changed from {before.get(key)} to {value}"))
        self._constants = now
        for name, body in self._fixed.items():
            place = self._place(body)
            if math.dist(place, self._places[name]) > FIXED_BODY_MOVED:
                self.jumps.append(Finding(stamp, f"{name}, which is fixed, has moved"))
                self._places[name] = place

    def _place(self, body: int) -> tuple[float, ...]:
        position, quaternion = self._reader.body_pose(body)
        return (*position, *quaternion)
