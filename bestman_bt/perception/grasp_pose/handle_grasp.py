"""Grasps of handles: fingers on both sides of a bar, around a knob, or over and behind the lip of a recessed edge."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import handle_motion
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import clear_candidates, hands_of, surroundings_of
from bestman_bt.robot_model.model import GripperModel


@dataclass(frozen=True, eq=False)
class _Way:
    """One way to hold it in the handle's frame: position, approach, closing (3,) each, and how good it is, 0 to 1."""

    position: NDArray[np.float64]
    approach: NDArray[np.float64]
    closing: NDArray[np.float64]
    quality: float


@dataclass(frozen=True)
class HandleGrasp(GraspPlanner):
    """Plans grasps of bars, knobs and lips. Raises PerceptionError for targets without a handle.

    Metres and radians.

    ``bar_tilts``: of the approach about a bar, from perpendicular to the front; ``knob_turns``: closing directions
    about a knob; ``knob_tilts``: of the approach there; ``edge_tilts``: of the approach to a lip; π/2 is along the
    front. ``tilt_weight``: fraction of the quality that a tilt of 45° costs. ``along``: positions along a bar or lip,
    as fractions of its free part; ``end``: length of a bar's ends occupied by its feet. ``front_clearance``: between
    open hand and front. ``back``: distance by which the tool frame may stop in front of the handle. ``lip``: from the
    handle's origin to the lip's free edge. Assumed dimensions of a recess: ``recess_width`` beyond that edge,
    ``recess_depth`` behind the lip, and ``pocket`` behind the front, measured from the origin. ``opened_by``: distance
    by which the handle has moved at ``lift``. ``surroundings_clearance``: of the open hand.
    """

    bar_tilts: Annotated[tuple[float, ...], "rad"] = tuple(math.radians(angle) for angle in (0, 20, -20, 40, -40))
    knob_turns: int = 6
    knob_tilts: Annotated[tuple[float, ...], "rad"] = tuple(math.radians(angle) for angle in (0, 20, -20))
    edge_tilts: Annotated[tuple[float, ...], "rad"] = tuple(math.radians(angle) for angle in (90, 75, 60))
    tilt_weight: float = 0.25
    along: tuple[float, ...] = (0.0, 0.5, -0.5)
    end: Annotated[float, "m"] = 0.025
    front_clearance: Annotated[float, "m"] = 0.003
    back: Annotated[float, "m"] = 0.008
    recess_width: Annotated[float, "m"] = 0.035
    recess_depth: Annotated[float, "m"] = 0.032
    lip: Annotated[float, "m"] = 0.010
    pocket: Annotated[float, "m"] = 0.020
    surroundings_clearance: Annotated[float, "m"] = 0.005
    opened_by: Annotated[float, "m"] = 0.05
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """Return the grasps of the target's handle, best first; ``support_height``: z of the floor or surface below the
        handle.

        Empty if the handle is too thick, or the hand has no room in front of it or behind it.
        """
        handle = target.handle
        if handle is None:
            raise PerceptionError("HandleGrasp needs a target with a handle: detect handles first")
        width = 2 * handle.radius
        if not self.hand.fits(width, gripper):
            return ()
        shape = HandShape(gripper, self.shape)
        ways = {"bar": self._bar, "knob": self._knob, "edge": self._edge}[handle.kind](handle, gripper)
        candidates = []
        for way in ways:
            for sign in (1.0, -1.0):
                placed = self._before_front(self._candidate(handle, way, sign, width, gripper), handle, shape)
                candidates += [placed] if placed else []
        others = surroundings_of(target, support_height, shape.reach + handle.length)
        candidates = clear_candidates(candidates, shape, others, support_height, self.surroundings_clearance)
        candidates = [candidate for candidate in candidates if candidate.clearance > 0.0]
        return tuple(sorted(candidates, key=lambda candidate: -candidate.quality))

    def _bar(self, handle: Handle, gripper: GripperModel) -> list[_Way]:
        """Return grasps that close across the bar, turned about it, at some places along it."""
        free = max(0.0, handle.length / 2 - self.end - gripper.part.pad_size[0] / 2)
        ways = []
        for share in self.along if free > 0.01 else (0.0,):
            for tilt in self.bar_tilts:
                approach = np.array([0.0, math.sin(tilt), -math.cos(tilt)])
                closing = np.array([0.0, math.cos(tilt), math.sin(tilt)])
                quality = self._tilted(tilt) * (1.0 - 0.15 * abs(share))
                ways.append(_Way(np.array([share * free, 0.0, 0.0]), approach, closing, quality))
        return ways

    def _knob(self, handle: Handle, gripper: GripperModel) -> list[_Way]:
        """Return grasps that close in all directions across the knob, also a little beside it."""
        ways = []
        for turn in np.arange(self.knob_turns) * math.pi / self.knob_turns:
            closing = np.array([math.cos(turn), math.sin(turn), 0.0])
            beside = np.array([-math.sin(turn), math.cos(turn), 0.0])
            for tilt in self.knob_tilts:
                approach = math.sin(tilt) * beside - np.array([0.0, 0.0, math.cos(tilt)])
                ways.append(_Way(np.zeros(3), approach, closing, 0.9 * self._tilted(tilt)))
        return ways

    def _edge(self, handle: Handle, gripper: GripperModel) -> list[_Way]:
        """Return grasps with one finger before the lip and the other in the recess behind it, from the
        lip's free side.
        """
        free = max(0.0, handle.length / 2 - gripper.part.pad_size[0])
        ways = []
        for side in free_sides(handle):
            for share in self.along if free > 0.01 else (0.0,):
                for tilt in self.edge_tilts:
                    approach = np.array([0.0, -side * math.sin(tilt), -math.cos(tilt)])
                    closing = np.array([0.0, -side * math.cos(tilt), math.sin(tilt)])
                    quality = 0.7 * self._tilted(math.pi / 2 - tilt) * (1.0 - 0.15 * abs(share))
                    ways.append(_Way(np.array([share * free, 0.0, 0.0]), approach, closing, quality))
        return ways

    def _tilted(self, tilt: float) -> float:
        return 1.0 - self.tilt_weight * abs(tilt) / (math.pi / 4)

    def _candidate(self, handle: Handle, way: _Way, sign: float, width: float, gripper: GripperModel) -> GraspCandidate:
        turn = handle.pose.rotation
        position = handle.pose.apply(way.position[None])[0]
        quality = way.quality * (0.5 + 0.5 * handle.confidence)
        candidate = self.hand.candidate(
            position, turn @ way.approach, sign * (turn @ way.closing), width, quality, "handle", gripper
        )
        return replace(candidate, lift=handle_motion(handle, self.opened_by) @ candidate.grasp)

    def _before_front(self, candidate: GraspCandidate, handle: Handle, shape: HandShape) -> GraspCandidate | None:
        """Return the candidate, drawn back where its finger tips would meet the front, or None if that is not
        enough.
        """
        for back in np.linspace(0.0, self.back, 5):
            moved = self._drawn_back(candidate, float(back), handle)
            if self._depth_in_front(moved, handle, shape) <= 0.0:
                return moved
        return None

    def _drawn_back(self, candidate: GraspCandidate, back: float, handle: Handle) -> GraspCandidate:
        if back == 0.0:
            return candidate
        shift = -back * candidate.grasp.rotation[:, 2]
        grasp = replace(candidate.grasp, position=candidate.grasp.position + shift)
        before = replace(candidate.pre_grasp, position=candidate.pre_grasp.position + shift)
        quality = candidate.quality * (1.0 - 0.3 * back / self.back)
        lift = handle_motion(handle, self.opened_by) @ grasp
        return replace(candidate, grasp=grasp, pre_grasp=before, lift=lift, quality=quality)

    def _depth_in_front(self, candidate: GraspCandidate, handle: Handle, shape: HandShape) -> float:
        """Return how deep the open hand penetrates the solids behind the front's face, metres; 0 or less: not at all.

        The recess beside and behind a lip is free.
        """
        points = handle.pose.inverse().apply(shape.outline(hands_of([candidate]), candidate.opening))
        depth = self.front_clearance - handle.standoff - points[:, 2]
        if handle.kind == "edge":
            back = handle.radius + self.recess_depth
            for side in free_sides(handle):
                beside = side * points[:, 1]
                in_recess = (beside > -self.pocket) & (beside < self.lip + self.recess_width) & (points[:, 2] > -back)
                in_recess &= np.abs(points[:, 0]) < handle.length / 2
                in_lip = (beside < self.lip) & (np.abs(points[:, 2]) < handle.radius)
                depth[in_recess & ~in_lip] = 0.0
        return float(depth.max())


def free_sides(handle: Handle) -> tuple[float, ...]:
    """Return the directions along y of the handle, +1 or -1, in which a lip's free edge may be: towards the panel's
    nearer border.

    Both, if the panel was not measured.
    """
    if handle.panel is None:
        return (1.0, -1.0)
    beside = float((handle.pose.position - handle.panel.position) @ handle.pose.rotation[:, 1])
    return (1.0,) if beside >= 0.0 else (-1.0,)
