"""The interface of a physics engine for ``hal.simulation``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose
from hal.simulation.audit_record import CallCounter
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
    """A built world that advances only by ``step``. SI units and radians; quaternions xyzw, in the map frame.

    Bodies, links and joints are numbers of the engine, listed by name in ``built``; -1 is a body's root link.
    ``ledger``: counts calls of the engine's own functions, which bypass this class.
    """

    built: BuiltWorld
    ledger: CallCounter

    @abstractmethod
    def step(self) -> None:
        """Advance by one physics step of the configured length."""

    @abstractmethod
    def close(self) -> None:
        """Free the engine's resources; idempotent."""

    @abstractmethod
    def track(
        self, joints: Sequence[int], positions: Array, velocities: Array, efforts: Sequence[float], gain: float
    ) -> None:
        """Move the robot's joints at ``velocities``, and correct the fraction ``gain`` of their errors to ``positions``
        per step.

        ``efforts``: maximum efforts of the motors, N m or N.
        """

    @abstractmethod
    def approach(self, joint: int, position: float, speed: float, effort: float) -> None:
        """Move a joint of the robot to ``position`` and hold it there.

        ``position``: m or rad. ``speed``, ``effort``: limits, m/s or rad/s, N or N m.
        """

    @abstractmethod
    def turn(self, body: int, joints: Sequence[int], speeds: Sequence[float], efforts: Sequence[float]) -> None:
        """Move joints of a body at ``speeds`` with bounded efforts; at speed 0, this acts as dry friction."""

    @abstractmethod
    def exert(self, joints: Sequence[int], efforts: Array) -> None:
        """Apply efforts to joints of the robot in the next step, in addition to those of ``turn``."""

    @abstractmethod
    def push(self, body: int, link: int, force: Vector, point: Vector) -> None:
        """Apply a force to a link in the next step, newtons, at ``point`` in the map frame."""

    @abstractmethod
    def joint_states(self, body: int, joints: Sequence[int]) -> JointStates:
        """Return positions, velocities, and the efforts of the motors in the latest step."""

    @abstractmethod
    def body_pose(self, body: int) -> tuple[Vector, Quaternion]:
        """Return the pose of the centre of mass of a body's root link."""

    @abstractmethod
    def body_velocity(self, body: int) -> tuple[Vector, Vector]:
        """Return the linear (m/s) and angular velocity (rad/s) of a body's centre of mass."""

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
        """Return all contacts, or those of a body as the first one, optionally of one of its links and with one other
        body.
        """

    @abstractmethod
    def gaps(self, body: int, other: int, within: float, link: int | None = None) -> Sequence[float]:
        """Return the distances up to ``within`` metres between a body and another one or its ``link``; negative:
        overlap.
        """

    @abstractmethod
    def cast_rays(self, starts: Array, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Cast rays between points (n, 3); returns the hit bodies (n,), -1 for none, and the fraction of each ray up to
        the hit (n,).
        """

    @abstractmethod
    def depth_image(
        self, map_from_optical: Pose, intrinsics: CameraIntrinsics, near: float, far: float, without: int = -1
    ) -> tuple[NDArray[np.uint8], Array]:
        """Render exact colour (H, W, 3) and depth (H, W), metres, of a pinhole (x right, y down), without distortion.

        The depth is 0 if it is below ``near`` (the pixel is still visible) or above ``far``, or for pixels of the body
        ``without``.
        """

    @abstractmethod
    def photo(self, viewpoint: Viewpoint, width: int, height: int) -> NDArray[np.uint8]:
        """Return a picture for people, (H, W, 3), with shadows."""

    @abstractmethod
    def segments(self, viewpoint: Viewpoint, width: int, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the body and the link shown by each pixel, (H, W) each; body -1 for the background."""

    @abstractmethod
    def put(self, body: int, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Place a body's centre of mass at a pose, at rest and awake; only for freely moving bodies."""

    @abstractmethod
    def set_joint(self, body: int, joint: int, position: float) -> None:
        """Set a joint to a position, at rest."""

    @abstractmethod
    def friction(self, body: int) -> tuple[float, float]:
        """Return the sliding and the spinning friction of a body's root link; the latter in metres."""

    @abstractmethod
    def set_friction(self, body: int, sliding: float, spinning: float) -> None:
        """Set both coefficients of friction, effective immediately, also in existing contacts."""

    def forget_contacts(self, body: int, link: int) -> None:  # noqa: B027 - for engines that keep contacts
        """Recompute the contacts of a link in the next step; without effect in engines that always do so."""

    @abstractmethod
    def constraint_count(self) -> int:
        """Return the number of constraints between bodies."""

    @abstractmethod
    def constants(self) -> Mapping[str, tuple[Any, ...]]:
        """Return the quantities that must not change in an audited run: gravity, time step, the number of bodies,
        ``friction of <body>`` (sliding, spinning), and masses and other link properties by link.
        """
