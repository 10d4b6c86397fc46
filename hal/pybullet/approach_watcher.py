"""Who came into whom where the robot touches somebody who walks."""

from __future__ import annotations

import numpy as np

from hal.pybullet.client import Reader
from hal.pybullet.observation import BodyState, Observation
from hal.pybullet.simulation import Contact

CLOSING = 0.02
"""Metres per second towards the other from which on a contact is the robot's doing."""


class ApproachWatcher:
    """Takes the contacts of a look one by one.

    The blow itself changes velocities: so the robot's body is judged by how it moved at the look before, 1/60 s ago;
    its links by how they move now, too, as an arm that reaches out is no motion of the body.
    """

    def __init__(self, robot: int, reader: Reader) -> None:
        self._robot = robot
        self._link_state = reader.getLinkState
        self._before: BodyState | None = None
        self._closing: set[tuple[int, int]] = set()

    def take(self, contact: Contact, observation: Observation) -> None:
        """A contact between the robot and a walker, as pybullet tells it, whichever of them comes first."""
        _, body_a, body_b, link_a, link_b, on_a, _, normal_on_b, *_ = contact
        first = body_a == self._robot
        link, other = (link_a, body_b) if first else (link_b, body_a)
        # From the robot to the other: pybullet's normal points from its second body to its first.
        towards = -np.array(normal_on_b) if first else np.array(normal_on_b)
        state = self._before or observation.bodies[self._robot]
        arm = np.array(on_a) - state.position
        speeds = [float(towards @ (np.array(state.linear) + np.cross(state.angular, arm)))]
        if link >= 0:
            linear, angular = self._link_state(self._robot, link, computeLinkVelocity=1)[6:8]
            centre = self._link_state(self._robot, link)[0]
            speeds.append(float(towards @ (np.array(linear) + np.cross(angular, np.array(on_a) - centre))))
        if max(speeds) > CLOSING:
            self._closing.add((link, other))

    def closing(self, link: int, other: int) -> bool:
        """Whether the robot has moved into ``other`` with this link at this look."""
        return (link, other) in self._closing

    def look_ends(self, observation: Observation) -> None:
        """The next contacts belong to the next look."""
        self._closing.clear()
        self._before = observation.bodies[self._robot]
