"""What a physics engine does for a simulated robot: all that the rest of ``hal.simulation`` asks of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose
from hal.simulation.audit_record import Ledger
from hal.simulation.bodies import (
    Array,
    BuiltWorld,
    ContactPoint,
    JointStates,
    LinkMotion,
    Quaternion,
    Vector,
    Viewpoint,
)


class Engine(ABC):
    """A world that is built and stands still until ``step``. SI units and radians; quaternions xyzw, in the map frame.

    Bodies, links and joints are the engine's own numbers, which ``built`` tells by name; -1 is a body's root link.
    ``ledger``: where functions of the engine's own, by which programs could come past this class, are counted.
    """

    built: BuiltWorld
    ledger: Ledger

    @abstractmethod
    def step(self) -> None:
        """Go on by one physics step, of the length that the engine was made with."""

    @abstractmethod
    def close(self) -> None:
        """Free what the engine holds; idempotent."""

    # Motors. Each command replaces the one before at its joints and holds until the next.

    @abstractmethod
    def track(
        self, joints: Sequence[int], positions: Array, velocities: Array, efforts: Sequence[float], gain: float
    ) -> None:
        """The robot's joints go on at ``velocities`` and make up ``gain`` of what they lack to ``positions`` in a step.

        ``efforts``: N m or N that a motor exerts at most.
        """

    @abstractmethod
    def approach(self, joint: int, position: float, speed: float, effort: float) -> None:
        """A joint of the robot goes to ``position`` and stays there, at most so fast and with so much effort."""

    @abstractmethod
    def turn(self, body: int, joints: Sequence[int], speeds: Sequence[float], efforts: Sequence[float]) -> None:
        """Joints of a body move at ``speeds`` with bounded efforts; at speed 0, that is dry friction."""

    @abstractmethod
    def exert(self, joints: Sequence[int], efforts: Array) -> None:
        """Efforts at joints of the robot in the next step, beside what ``turn`` has asked of them."""

    @abstractmethod
    def push(self, body: int, link: int, force: Vector, point: Vector) -> None:
        """A force on a link in the next step, at a point of the map."""

    # What is true

    @abstractmethod
    def joint_states(self, body: int, joints: Sequence[int]) -> JointStates:
        """Positions, velocities, and the efforts of the motors in the latest step."""

    @abstractmethod
    def body_pose(self, body: int) -> tuple[Vector, Quaternion]:
        """Return the pose of the centre of mass of a body's root link."""

    @abstractmethod
    def body_velocity(self, body: int) -> tuple[Vector, Vector]:
        """Return the linear and angular velocity of the same."""

    @abstractmethod
    def link_pose(self, body: int, link: int) -> Pose:
        """Return the pose of a link's frame at the current joint positions."""

    @abstractmethod
    def link_motions(self, body: int, links: Collection[int]) -> Sequence[LinkMotion]:
        """Return the motions of links other than the root after the latest step."""

    @abstractmethod
    def contacts(
        self, body: int | None = None, link: int | None = None, other: int | None = None
    ) -> Sequence[ContactPoint]:
        """Return all contacts, or those of a body, which is the first in them then: of one of its links, with one
        other.
        """

    @abstractmethod
    def gaps(self, body: int, other: int, within: float, link: int | None = None) -> Sequence[float]:
        """Distances of up to ``within`` metres between a body and another one or its ``link``; negative: overlap."""

    @abstractmethod
    def cast_rays(self, starts: Array, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Cast rays between points (n, 3); returns the hit bodies (n,), -1 for none, and the share of each ray (n,)."""

    @abstractmethod
    def depth_image(
        self, map_from_optical: Pose, intrinsics: CameraIntrinsics, near: float, far: float, without: int = -1
    ) -> tuple[NDArray[np.uint8], Array]:
        """Exact colour (H, W, 3) and depth (H, W) metres of a pinhole (x right, y down), without distortion.

        The depth is 0 where it is less than ``near``, though that is in the picture, or more than ``far``, or of the
        body ``without``.
        """

    @abstractmethod
    def photo(self, viewpoint: Viewpoint, width: int, height: int) -> NDArray[np.uint8]:
        """Return a picture for people, (H, W, 3), with shadows."""

    @abstractmethod
    def segments(self, viewpoint: Viewpoint, width: int, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Which body and which of its links each pixel shows, (H, W) each; body -1 where there is none."""

    # What no honest run does, but for people who disturb

    @abstractmethod
    def put(self, body: int, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Put a body's centre of mass somewhere, at rest and awake; for bodies that can move as a whole."""

    @abstractmethod
    def set_joint(self, body: int, joint: int, position: float) -> None:
        """Put a joint to a position, at rest."""

    @abstractmethod
    def friction(self, body: int) -> tuple[float, float]:
        """Coefficients of sliding and of spinning friction of a body's root link; the latter in metres."""

    @abstractmethod
    def set_friction(self, body: int, sliding: float, spinning: float) -> None:
        """Set both coefficients of friction, effective at once, also in existing contacts."""

    def forget_contacts(self, body: int, link: int) -> None:  # noqa: B027 - for engines that keep contacts
        """Find what a link touches afresh in the next step; an engine that does so anyway has nothing to do."""

    @abstractmethod
    def constraint_count(self) -> int:
        """Return how many constraints between bodies there are."""

    @abstractmethod
    def constants(self) -> Mapping[str, tuple[Any, ...]]:
        """What an honest run leaves as it is, by what it is: gravity, time step, the number of bodies, ``friction of
        <body>`` (sliding, spinning), and masses and the like by link.
        """
