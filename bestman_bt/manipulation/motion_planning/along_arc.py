"""A path constraint: the tool follows a handle on its way, an arc about a hinge or a line."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.kinematics.arc_path import arc_path
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.motion_planning.base import MotionPlan, PlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.checked_edges import CheckedEdges
from bestman_bt.manipulation.motion_planning.query import describe_contacts
from bestman_bt.manipulation.motion_planning.validity import CountedValidity
from bestman_bt.messages import Pose

Motion = Callable[[float], Pose]
"""The rigid motion, in the base frame, that carries the handle so many metres along its way."""


@dataclass(frozen=True)
class AlongArcParameters:
    """``station``: metres between the poses that are solved for. ``turn_step``: rad between turns of the hand.

    ``position_tolerance``, ``rotation_tolerance``: metres and rad by which the tool may leave its way; ``slack``: by
    how much more, as a factor, a timed motion may. ``check_step``: rad between checked points. ``wall_limit``:
    seconds after which planning is aborted with an error.
    """

    station: float = 0.01
    turn_step: float = math.radians(5.0)
    position_tolerance: float = 0.002
    rotation_tolerance: float = math.radians(1.5)
    slack: float = 1.5
    check_step: float = 0.01
    wall_limit: float = 60.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise ManipulationError(f"AlongArcParameters {name} should be above 0 but is {value}")


class AlongArc:
    """The tool moves with what it holds: at ``motion(d) @ base_from_tool`` for a ``d`` of 0 to ``distance`` metres.

    ``turn_axis``: (3,) in the tool frame, about which the hand may turn by ``max_turn`` rad either way on what it
    holds (a bar); without it the hand keeps its place on the handle.
    """

    def __init__(
        self,
        kinematics: InverseKinematics,
        base_from_tool: Pose,
        motion: Motion,
        distance: float,
        turn_axis: ArrayLike | None = None,
        max_turn: float = 0.0,
        parameters: AlongArcParameters | None = None,
    ) -> None:
        if not 0.0 < distance < math.inf:
            raise ManipulationError(f"AlongArc distance should be above 0 and finite but is {distance}")
        self.parameters = parameters or AlongArcParameters()
        self._kinematics = kinematics
        self._start = base_from_tool
        self._motion = motion
        self._distance = distance
        axis = np.array([0.0, 0.0, 1.0]) if turn_axis is None else np.asarray(turn_axis, dtype=float)
        self._axis = axis / np.linalg.norm(axis)
        self._max_turn = 0.0 if turn_axis is None else max_turn
        count = max(1, math.ceil(distance / self.parameters.station))
        self._marks = np.linspace(0.0, distance, count + 1)
        self._poses = [motion(float(d)) @ base_from_tool for d in self._marks]
        self._positions = np.array([pose.position for pose in self._poses])

    @property
    def description(self) -> str:
        """What is asked, for error messages."""
        p = self.parameters
        return (
            f"the tool on the handle's way of {self._distance:.2f} m within {p.position_tolerance * 1e3:.1f} mm and "
            f"{math.degrees(p.rotation_tolerance):.1f} degrees"
        )

    def satisfied(self, positions: NDArray[np.float64]) -> bool:
        """Whether it holds at ``positions`` (n,)."""
        return self._within(positions, 1.0)

    def tolerated(self, positions: NDArray[np.float64]) -> bool:
        """Whether it holds at ``positions`` (n,) but for the slack."""
        return self._within(positions, self.parameters.slack)

    def progress(self, positions: NDArray[np.float64]) -> float:
        """How far along its way the tool is at ``positions`` (n,), metres."""
        return self._nearest(self._kinematics.tool_pose(positions).position)

    def stations(self) -> list[list[Pose]]:
        """For each station the tool poses that are allowed there, from the least to the greatest turn of the hand."""
        steps = math.floor(self._max_turn / self.parameters.turn_step + 1e-9)
        turns = [self._turn(k * self.parameters.turn_step) for k in range(-steps, steps + 1)]
        return [[pose @ turn for turn in turns] for pose in self._poses]

    def plan(
        self,
        start: ArrayLike,
        limits: JointLimits,
        world_at: Callable[[float], CollisionWorld],
    ) -> MotionPlan:
        """The joint path from ``start`` (n,), where the tool holds the handle, to the end of its way.

        ``world_at``: the collision world when the handle is so many metres on (its door stands elsewhere then).
        Raises PlanningError if the start is off the way or in collision, or there is no path (the message says how
        far it comes); ManipulationError for NaN or a wrong shape.
        """
        origin = joint_vector(start, len(limits.joint_names), "start")
        worlds = [world_at(float(d)) for d in self._marks]
        if not self.satisfied(origin):
            raise PlanningError(PlanningErrorCode.START_VIOLATES_CONSTRAINT, f"the start breaks: {self.description}")
        if not worlds[0].is_free(origin):
            touching = describe_contacts(worlds[0], origin)
            raise PlanningError(PlanningErrorCode.START_IN_COLLISION, f"the start is in collision: {touching}")
        found = arc_path(
            self._kinematics, self.stations(), origin, limits, lambda q, station: bool(worlds[station].is_free(q))
        )
        if not found.complete:
            reached = self._marks[max(0, len(found.path) - 1)]
            raise PlanningError(
                PlanningErrorCode.NO_PATH,
                f"the arm follows the handle for {reached:.2f} of {self._distance:.2f} m: {found.failure}",
            )
        path = np.vstack([origin, found.path]) if np.abs(found.path[0] - origin).max() > 1e-6 else found.path
        return MotionPlan(path, 0, self._check(path, worlds))

    def _check(self, path: NDArray[np.float64], worlds: list[CollisionWorld]) -> int:
        """Check between the stations, in the worlds at both ends; returns the number of checks."""
        step, checks = self.parameters.check_step, 0
        extra = len(path) - len(worlds)
        for i in range(len(path) - 1):
            for station in {max(0, i - extra), max(0, i + 1 - extra)}:
                validity = CountedValidity(worlds[station], self, self.parameters.wall_limit)
                if not CheckedEdges(validity, step, step).is_free(path[i], path[i + 1]):
                    raise PlanningError(
                        PlanningErrorCode.NO_PATH,
                        f"the arm touches or leaves the way {self._marks[max(0, i - extra)]:.2f} m along it",
                    )
                checks += validity.checks
        return checks

    def _within(self, positions: NDArray[np.float64], factor: float) -> bool:
        tool = self._kinematics.tool_pose(positions)
        asked = self._motion(self._nearest(tool.position)) @ self._start
        if np.linalg.norm(tool.position - asked.position) > factor * self.parameters.position_tolerance:
            return False
        tolerance = factor * self.parameters.rotation_tolerance
        asked_from_tool = asked.inverse() @ tool
        along = float(asked_from_tool.quaternion[:3] @ self._axis)
        turn = 2.0 * math.atan2(along, float(asked_from_tool.quaternion[3]))
        turn = (turn + math.pi) % (2.0 * math.pi) - math.pi
        turn = min(self._max_turn, max(-self._max_turn, turn))
        rest = (asked_from_tool @ self._turn(-turn)).quaternion
        return 2.0 * math.acos(min(1.0, abs(float(rest[3])))) <= tolerance

    def _nearest(self, position: NDArray[np.float64]) -> float:
        """Metres along the way of the point nearest to ``position`` (3,)."""
        i = int(np.argmin(np.linalg.norm(self._positions - position, axis=1)))
        best, least = float(self._marks[i]), math.inf
        for a, b in ((i - 1, i), (i, i + 1)):
            if a < 0 or b >= len(self._marks):
                continue
            way = self._positions[b] - self._positions[a]
            share = float(np.clip(way @ (position - self._positions[a]) / max(float(way @ way), 1e-12), 0.0, 1.0))
            gap = float(np.linalg.norm(self._positions[a] + share * way - position))
            if gap < least:
                best, least = float(self._marks[a] + share * (self._marks[b] - self._marks[a])), gap
        return best

    def _turn(self, angle: float) -> Pose:
        return Pose(np.zeros(3), np.append(math.sin(angle / 2) * self._axis, math.cos(angle / 2)))
