"""Grasp candidates of believed objects and handles, in the base frame, reachable or not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from bestman_bt.engine import OneOf
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.world_model.world_model import HandleBelief, ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.perception.grasp_pose.base import GraspCandidate


NEIGHBOURHOOD = 0.5
"""Radius around an object within which other objects may obstruct the hand, metres."""
OBLIQUE = 0.5
"""Smallest cosine between the hand's direction and the direction straight into a drawer or a cupboard."""
SURROUNDINGS_SPACING = 0.01
"""Distance between the points that represent other objects, metres."""

YAW_STEP = math.radians(10.0)
"""Largest step between the possible yaws of an object at which the hand must not touch it, radians."""

GraspApproach = Annotated[str, OneOf(lambda: ("", "top", "side"))]
APPROACH = "from where the hand comes, top or side; by default any"
"""Text of a port with such a value."""


def grasp_candidates(skills: SkillContext, belief: ObjectBelief, approach: str = "") -> tuple[GraspCandidate, ...]:
    """Return grasps of a believed object in the base frame, best first; without a model, from its points.

    ``approach``: ``top`` or ``side`` for only those grasps.
    """
    from bestman_bt.perception.grasp_pose.base import GraspTarget

    base_from_map = skills.map_from_base.inverse()
    base_from_object = base_from_map @ belief.pose
    support_height = float(base_from_object.position[2] + belief.model.bounds()[0, 2])
    if belief.recognised:
        target = GraspTarget.of_model(belief.model, base_from_object)
        elsewhere = _at_other_yaws(belief, base_from_map)
        # Prefer grasps that avoid the object at all of its possible yaws to those that avoid it at the estimated one.
        for surroundings in (elsewhere, None) if elsewhere is not None else (None,):
            tried = replace(target, surroundings=surroundings)
            candidates = skills.grasp_pose.plan(tried, skills.gripper_model, support_height)
            candidates = _of_kind(approach, _from_the_open_side(skills, belief, candidates))
            if candidates:
                break
        return candidates
    box = belief.model.collision[0]
    target = GraspTarget(
        box=replace(box, pose=base_from_object @ box.pose),
        cloud=None if belief.cloud is None else belief.cloud.transformed(base_from_map),
        viewpoints=None if belief.viewpoint is None else base_from_map.apply(belief.viewpoint[None]),
        surroundings=_surroundings(skills, belief, base_from_map),
    )
    return _of_kind(approach, skills.unknown_grasp_pose.plan(target, skills.gripper_model, support_height))


def _of_kind(approach: str, candidates: tuple[GraspCandidate, ...]) -> tuple[GraspCandidate, ...]:
    return tuple(one for one in candidates if approach in ("", one.approach))


def _from_the_open_side(
    skills: SkillContext, belief: ObjectBelief, candidates: tuple[GraspCandidate, ...]
) -> tuple[GraspCandidate, ...]:
    """Return the grasps that enter furniture through its opening: into drawers from above, behind
    doors from the front.
    """
    known = skills.world.map
    furniture, surface = known.surface(belief.surface) if belief.surface else (None, None)
    if furniture is None or surface is None or not furniture.is_inside(surface):
        return candidates
    if surface.drawer is not None:
        inwards = np.array([0.0, 0.0, -1.0])
    else:
        inwards = skills.map_from_base.inverse().rotation @ furniture.pose.to_pose().rotation[:, 0]
    straight = tuple(one for one in candidates if float(one.grasp.rotation[:, 2] @ inwards) > OBLIQUE)
    return straight if surface.drawer is not None else _camera_above(skills, straight)


def _camera_above(skills: SkillContext, candidates: tuple[GraspCandidate, ...]) -> tuple[GraspCandidate, ...]:
    """Return the grasps with the hand's camera above the hand; below, it would touch the placing surface later."""
    if skills.wrist_camera is None:
        return candidates
    tool_from_camera = skills.base_from_tool().inverse() @ skills.wrist_camera.base_from_camera()
    return tuple(one for one in candidates if (one.grasp @ tool_from_camera).position[2] > one.grasp.position[2])


def handle_grasp_candidates(skills: SkillContext, belief: HandleBelief) -> tuple[GraspCandidate, ...]:
    """Return grasps of a believed handle in the base frame, best first."""
    from bestman_bt.perception.grasp_pose.base import GraspTarget

    handle = belief.handle.seen_from(skills.map_from_base.inverse())
    size = (handle.length, 2 * handle.radius, 2 * handle.radius)
    target = GraspTarget(PlacedShape(Box(size), handle.pose), handle=handle)
    return skills.handle_grasp_pose.plan(target, skills.gripper_model, support_height=0.0)


def _at_other_yaws(belief: ObjectBelief, base_from_map: Pose) -> NDArray[np.float64] | None:
    """Return where parts of an object without symmetry may also be, such as the handle of a mug that is seen from the
    other side: points (N, 3) of its surface at all possible yaws, in the base frame.
    """
    from scipy.spatial import KDTree

    from bestman_bt.perception.tracking import at_yaw

    if belief.model.symmetry_order != 1:
        return None
    arcs = belief.yaw_set.arcs
    if not arcs:
        return None
    yaws = [
        middle + turn for middle, half in arcs for turn in np.linspace(-half, half, 1 + math.ceil(2 * half / YAW_STEP))
    ]
    surface = _surface(belief.model)
    points = np.concatenate([at_yaw(belief, yaw).apply(surface) for yaw in yaws])
    distances, _ = KDTree(belief.pose.apply(surface)).query(points)
    return base_from_map.apply(points[distances > SURROUNDINGS_SPACING])


def _surface(model: ObjectModel) -> NDArray[np.float64]:
    """Return the points of a model's surface, (N, 3) metres, in its frame."""
    from bestman_bt.perception.pose_estimation.model_surface import sample_shape

    return np.concatenate(
        [part.pose.apply(sample_shape(part.shape, SURROUNDINGS_SPACING)[0]) for part in model.collision]
    )


def _surroundings(skills: SkillContext, belief: ObjectBelief, base_from_map: Pose) -> NDArray[np.float64]:
    """Return points (N, 3), metres, base frame, of everything else that is believed near an object."""
    points = [np.empty((0, 3))]
    for other in skills.world.objects.values():
        near = np.linalg.norm(other.pose.position - belief.pose.position) < NEIGHBOURHOOD
        if other.name != belief.name and near:
            points.append(other.pose.apply(_surface(other.model)))
    return base_from_map.apply(np.concatenate(points))
