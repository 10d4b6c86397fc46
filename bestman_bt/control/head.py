"""Pan-tilt heads: turn a camera so that it looks at a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.control.motion import Confirm, PlannedMotion, declined, start_motion
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import MotionErrorCode
from hal.api import JointGroup, Motion


class HeadController:
    """Points the camera of ``optical_frame`` with the joints of one group of any kinematics.

    ``confirm``: asks a person before each motion, which fails as DECLINED if refused.
    """

    def __init__(
        self,
        group: JointGroup,
        kinematics: ForwardKinematics,
        joints: JointStateSensor,
        optical_frame: str,
        tolerance: float = math.radians(3.0),
        confirm: Confirm | None = None,
    ) -> None:
        self._confirm = confirm
        self._group, self.name = group, group.name
        self._kinematics = kinematics
        self._joints = joints
        self._optical_frame = optical_frame
        self._tolerance = tolerance

    def look_at(self, point: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Move ``point`` (3,), metres in the base frame, to the middle of the image; succeeds when the head rests.

        Fails as UNREACHABLE, without moving, if the camera cannot point at it within the tolerance.
        """
        target = np.asarray(point, dtype=float)
        positions, miss = self._solve(target)
        if miss > self._tolerance:
            motion: Motion[None] = Motion(self.name)
            place = ", ".join(f"{value:.2f}" for value in target)
            motion.fail(
                MotionErrorCode.UNREACHABLE,
                f"{self.name} cannot look at ({place}) m (base frame): {math.degrees(miss):.0f}° beyond its limits",
            )
            return motion
        return self.move_to(positions, speed_scale)

    def move_to(self, positions: ArrayLike, speed_scale: float = 1.0) -> Motion[None]:
        """Move the joints to ``positions`` (n,), radians; succeeds when they rest there."""

        def planned() -> PlannedMotion:
            named = zip(self._group.joint_names, np.asarray(positions, dtype=float).tolist(), strict=False)
            return PlannedMotion(self.name, "to " + ", ".join(f"{joint} {at:.2f}" for joint, at in named))

        if (refused := declined(self._confirm, planned)) is not None:
            return refused
        return start_motion(self.name, lambda: self._group.move_to(positions, speed_scale))

    def stop(self) -> None:
        """Stop the head immediately."""
        self._group.stop()

    def _solve(self, point: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Return joint positions (n,) that look at the point as well as the limits allow, and the remaining angle,
        radians.
        """
        others = dict(self._joints.positions())
        names, lower, upper = self._group.joint_names, self._group.model.lower, self._group.model.upper

        def miss(positions: NDArray[np.float64]) -> NDArray[np.float64]:
            joints = {**others, **dict(zip(names, positions.tolist(), strict=True))}
            direction = self._kinematics.pose(self._optical_frame, joints).inverse().apply(point)
            unit: NDArray[np.float64] = direction / np.linalg.norm(direction) - (0.0, 0.0, 1.0)
            return unit

        inside = 1e-6 * (upper - lower)
        starts = (np.array([others[name] for name in names]), np.zeros(len(names)), (lower + upper) / 2)
        best: tuple[float, NDArray[np.float64]] | None = None
        for start in starts:
            found = least_squares(miss, np.clip(start, lower + inside, upper - inside), bounds=(lower, upper))
            if best is None or found.cost < best[0] - 1e-9:
                best = float(found.cost), found.x
            if best[0] < 1e-6:
                break
        assert best is not None
        chord = math.sqrt(2.0 * best[0])
        return best[1], 2.0 * math.asin(min(1.0, chord / 2.0))
