"""Antipodal grasps from a known model: from its shape where that is a box, cylinder or ball, else from sampled pairs.

Two contacts are antipodal where the line between them lies in both friction cones (Nguyen, "Constructing
Force-Closure Grasps", 1988).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, ObjectModel, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacementParameters
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.robot_model import GripperModel

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ModelBasedParameters:
    """Metres and radians.

    ``yaw_step``: between grasps around an axis of revolution. ``sides``: also propose grasps from the side.
    ``spacing``: of sampled contacts on meshes and composed shapes; ``friction``: of their cones, tan of the half angle.
    ``max_candidates``: how many are returned.
    """

    yaw_step: float = math.radians(30.0)
    sides: bool = True
    spacing: float = 0.006
    friction: float = 0.3
    max_candidates: int = 120
    hand: HandPlacementParameters = field(default_factory=HandPlacementParameters)


@dataclass(frozen=True, eq=False)
class _Contacts:
    """A pair of contacts in the frame: its middle and unit direction (3,), distance, and 0 to 1 how good it is.

    ``slack``: how far above or below the middle the same pair is found again, metres.
    """

    centre: NDArray[np.float64]
    closing: NDArray[np.float64]
    width: float
    quality: float
    slack: float


class ModelBased(GraspPlanner):
    """See the module. Needs targets with a model; raises PerceptionError for others."""

    def __init__(self, parameters: ModelBasedParameters | None = None) -> None:
        self.parameters = parameters or ModelBasedParameters()

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """See GraspPlanner."""
        if target.model is None or target.frame_from_object is None:
            raise PerceptionError("ModelBased needs a target with a model; for an unknown object use BoundingBox")
        outline = self._outline(target.model, target.frame_from_object)
        candidates = [
            candidate
            for contacts in self._contacts(target.model, target.frame_from_object)
            if self.parameters.hand.fits(contacts.width, gripper)
            for candidate in self._hands(contacts, outline, gripper, support_height)
        ]
        candidates.sort(key=lambda candidate: -candidate.quality)
        return tuple(candidates[: self.parameters.max_candidates])

    def _outline(self, model: ObjectModel, frame_from_object: Pose) -> NDArray[np.float64]:
        """Samples of the collision shapes' surface in the frame, (n, 3): what the hand must not touch."""
        return np.concatenate(
            [
                (frame_from_object @ placed.pose).apply(sample_shape(placed.shape, self.parameters.spacing)[0])
                for placed in model.collision
            ]
        )

    def _contacts(self, model: ObjectModel, frame_from_object: Pose) -> Iterator[_Contacts]:
        if len(model.collision) > 1:
            yield from self._sampled(model, frame_from_object)
            return
        placed = model.collision[0]
        pose = frame_from_object @ placed.pose
        axes, centre = pose.rotation.T, pose.position
        turns = np.arange(0.0, math.pi - 1e-9, self.parameters.yaw_step)
        match placed.shape:
            case Box() as box:
                for i in range(3):
                    others = [axis for axis in range(3) if axis != i]
                    level = min(others, key=lambda axis: abs(axes[axis, 2]))
                    slack = box.size[sum(others) - level] / 2
                    for share in (0.0, -0.5, 0.5):
                        middle = centre + share * (box.size[level] / 2) * axes[level]
                        yield _Contacts(middle, axes[i], box.size[i], 1.0 - 0.4 * abs(share), slack)
            case Cylinder() as cylinder:
                stands = abs(axes[2, 2]) > 0.97
                slack = cylinder.length / 2 if stands else cylinder.radius / 2
                for turn in turns if stands else ():
                    closing = math.cos(turn) * axes[0] + math.sin(turn) * axes[1]
                    yield _Contacts(centre, closing, 2 * cylinder.radius, 1.0, slack)
                if not stands:
                    closing = np.cross(axes[2], UP)
                    closing /= np.linalg.norm(closing)
                    for share in (0.0, -0.5, 0.5):
                        middle = centre + share * (cylinder.length / 2) * axes[2]
                        yield _Contacts(middle, closing, 2 * cylinder.radius, 1.0 - 0.4 * abs(share), slack)
            case Sphere() as ball:
                for turn in turns:
                    closing = np.array([math.cos(turn), math.sin(turn), 0.0])
                    yield _Contacts(centre, closing, 2 * ball.radius, 1.0, ball.radius / 2)
            case _:
                yield from self._sampled(model, frame_from_object)

    def _sampled(self, model: ObjectModel, frame_from_object: Pose) -> Iterator[_Contacts]:
        """Pairs of samples whose normals oppose each other along the line between them."""
        parts = [sample_shape(placed.shape, self.parameters.spacing) for placed in model.collision]
        points = np.concatenate(
            [placed.pose.apply(part[0]) for placed, part in zip(model.collision, parts, strict=True)]
        )
        normals = np.concatenate(
            [part[1] @ placed.pose.rotation.T for placed, part in zip(model.collision, parts, strict=True)]
        )
        points, normals = frame_from_object.apply(points), normals @ frame_from_object.rotation.T
        kept = np.linspace(0, len(points) - 1, min(len(points), 1200)).astype(np.intp)
        points, normals = points[kept], normals[kept]
        lines = points[None, :, :] - points[:, None, :]
        lengths = np.linalg.norm(lines, axis=2)
        safe = np.maximum(lengths, 1e-9)
        cone = 1.0 / math.sqrt(1.0 + self.parameters.friction**2)
        leaving = -np.einsum("ijk,ik->ij", lines, normals) / safe
        arriving = np.einsum("ijk,jk->ij", lines, normals) / safe
        first, second = np.nonzero(np.triu((leaving > cone) & (arriving > cone) & (lengths > 0.004), 1))
        alignment = np.minimum(leaving[first, second], arriving[first, second])
        order = np.argsort(-alignment, kind="stable")[: 4 * self.parameters.max_candidates]
        middle = points.mean(axis=0)
        for i, j, quality in zip(first[order], second[order], alignment[order], strict=True):
            centre = (points[i] + points[j]) / 2
            off_centre = float(np.linalg.norm((centre - middle)[:2]))
            direction = lines[i, j] / lengths[i, j]
            good = float(quality) - 4.0 * off_centre
            yield _Contacts(centre, direction, float(lengths[i, j]), good, self.parameters.spacing)

    def _hands(
        self, contacts: _Contacts, outline: NDArray[np.float64], gripper: GripperModel, support_height: float
    ) -> Iterator[GraspCandidate]:
        if abs(contacts.closing[2]) > 0.26:
            return
        level = contacts.closing - contacts.closing[2] * UP
        level /= np.linalg.norm(level)
        for sign in (1.0, -1.0):
            yield from self._from_top(contacts, sign * level, outline, gripper, support_height)
            if self.parameters.sides:
                yield from self._from_side(contacts, sign * level, outline, gripper, support_height)

    def _from_top(
        self,
        contacts: _Contacts,
        closing: NDArray[np.float64],
        outline: NDArray[np.float64],
        gripper: GripperModel,
        support_height: float,
    ) -> Iterator[GraspCandidate]:
        hand = self.parameters.hand
        across = np.cross(closing, UP)
        beside = np.abs((outline - contacts.centre) @ across) < hand.hand_half_thickness
        top = float(outline[beside, 2].max()) if beside.any() else float(outline[:, 2].max())
        deepest = hand.top_height(top, support_height, gripper)
        if deepest is None:
            return
        height = max(deepest, float(contacts.centre[2]) - contacts.slack)
        if height > min(float(contacts.centre[2]) + contacts.slack, top - 0.2 * gripper.pad_size[1]):
            return
        position = np.array([contacts.centre[0], contacts.centre[1], height])
        depth = (top - height) / hand.reach(gripper)
        margin = 1.0 - contacts.width / gripper.max_width
        quality = contacts.quality * (0.6 + 0.25 * depth + 0.15 * margin)
        yield hand.candidate(position, -UP, closing, contacts.width, quality, "top", gripper)

    def _from_side(
        self,
        contacts: _Contacts,
        closing: NDArray[np.float64],
        outline: NDArray[np.float64],
        gripper: GripperModel,
        support_height: float,
    ) -> Iterator[GraspCandidate]:
        hand = self.parameters.hand
        approach = np.cross(closing, UP)
        lowest = support_height + hand.hand_half_thickness + hand.support_clearance
        top = float(outline[:, 2].max())
        height = max(float(contacts.centre[2]), lowest)
        if height > min(float(contacts.centre[2]) + contacts.slack, top - gripper.pad_size[0] / 2):
            return
        # The near end of the object must stay before the palm.
        near = float(((contacts.centre - outline) @ approach).max())
        behind = max(0.0, near - (gripper.finger_depth - hand.palm_clearance))
        if behind > 0.3 * near:
            return
        position = np.array([contacts.centre[0], contacts.centre[1], height]) - behind * approach
        rise = (height - float(contacts.centre[2])) / max(top - support_height, 1e-6)
        margin = 1.0 - contacts.width / gripper.max_width
        quality = 0.8 * contacts.quality * (0.7 + 0.15 * margin) - 0.3 * rise - 5.0 * behind
        yield hand.candidate(position, approach, closing, contacts.width, quality, "side", gripper)
