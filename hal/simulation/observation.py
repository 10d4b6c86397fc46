"""One observation of the simulation by the audit monitor, shared by all watchers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.model import GripperModel
from hal.simulation.bodies import BodyState, ContactPoint, Vector
from hal.simulation.guards import Reader
from hal.simulation.simulation import Simulation


class SimulationState(NamedTuple):
    """One observation of the simulation. ``bodies``: objects and the robot's root link, by body. ``contacts``: all.

    ``joints``: rows position, velocity, effort of the driven joints. ``fingers``: link → position (3,).
    """

    stamp: float
    bodies: dict[int, BodyState]
    contacts: Sequence[ContactPoint]
    joints: NDArray[np.float64]
    fingers: dict[int, Vector]


class Observer:
    """Takes observations."""

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        self._simulation = simulation
        built = simulation.built
        self._robot = built.robot
        self._bodies = (*built.objects.values(), built.robot)
        self._fingers = [
            built.links[link]
            for gripper in simulation.model.of(GripperModel).values()
            for link in gripper.part.finger_links
        ]
        self._pose, self._velocity, self._links = reader.body_pose, reader.body_velocity, reader.link_motions
        self._reader = reader

    def observe(self) -> SimulationState:
        """Observe the current state."""
        simulation = self._simulation
        pose, velocity = self._pose, self._velocity
        bodies = {body: BodyState(*pose(body), *velocity(body)) for body in self._bodies}
        links = self._links(self._robot, self._fingers) if self._fingers else ()
        return SimulationState(
            stamp=simulation.elapsed,
            bodies=bodies,
            contacts=simulation.contacts(self._reader),
            joints=simulation.joint_states(),
            fingers={link: motion.position for link, motion in zip(self._fingers, links, strict=True)},
        )
