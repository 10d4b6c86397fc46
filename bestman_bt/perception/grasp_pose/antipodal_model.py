"""Antipodal grasps on a model's surface, found once per object.

Two contacts are antipodal where the line between them lies in both friction cones (Nguyen, "Constructing
Force-Closure Grasps", 1988). Contacts are sampled, rays through the solid give their opposites, and each pair is tried
with hands turned about the closing axis. The pads are then closed on the samples: thin walls (rims, handles) need no
case of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectGrasp, ObjectModel, Pose
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacementParameters
from bestman_bt.perception.grasp_pose.hand_shape import HandPoses, HandShape, HandShapeParameters
from bestman_bt.perception.grasp_pose.pad_contact import PadContacts, close_pads
from bestman_bt.perception.grasp_pose.solid_surface import SolidSurface, solid_surface
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class AntipodalModelParameters:
    """Metres, radians.

    ``samples``: about how many points the surface gets; ``contacts``: how many of them are tried as a first contact.
    ``friction``: of the cones, tangent of the half angle. ``turn``: between hands about one closing axis.
    ``patch_depth``: how far the pads give way. ``bulge``: by how much the object may be wider between the fingers above
    the pads. ``surface_clearance``: between open hand and object; the palm keeps ``hand.palm_clearance``.
    ``mass_arm``: of the centre of mass about the closing axis, at which quality falls to 1/e.
    ``apart``, ``apart_angle``: two grasps nearer than both count as one.
    """

    samples: int = 2200
    contacts: int = 220
    friction: float = 0.35
    turn: float = math.radians(30.0)
    patch_depth: float = 0.0012
    bulge: float = 0.004
    surface_clearance: float = 0.002
    mass_arm: float = 0.06
    apart: float = 0.012
    apart_angle: float = math.radians(25.0)
    hand: HandPlacementParameters = field(default_factory=HandPlacementParameters)
    shape: HandShapeParameters = field(default_factory=HandShapeParameters)


def antipodal_grasps(
    model: ObjectModel,
    gripper: GripperModel,
    rng: np.random.Generator,
    count: int = 64,
    parameters: AntipodalModelParameters | None = None,
) -> tuple[ObjectGrasp, ...]:
    """Up to ``count`` different grasps of ``model``, best first; from all sides, since it may come to lie on any.

    Empty where the gripper cannot take it. Raises PerceptionError for a model without collision shapes.
    """
    parameters = parameters or AntipodalModelParameters()
    rough = solid_surface(model, 0.010)
    spacing = 0.010 * math.sqrt(max(len(rough.points), 1) / parameters.samples)
    surface = solid_surface(model, spacing)
    starts, closing, widths = _pairs(surface, gripper, rng, parameters)
    hands = _turned_hands(starts + closing * widths[:, None] / 2, closing, parameters.turn)
    turns = len(hands) // max(len(starts), 1)
    openings = np.minimum(gripper.max_width, np.repeat(widths, turns) + 4 * parameters.hand.clearance)
    contacts = close_pads(
        surface.points,
        surface.normals,
        hands,
        openings,
        gripper.pad_size,
        gripper.finger_depth,
        parameters.patch_depth,
    )
    quality = _quality(hands, contacts, surface.centre_of_mass, gripper, parameters)
    tried = np.argsort(-quality, kind="stable")
    tried = tried[quality[tried] > 0.0]
    # The pads decide where the middle is: the hand closes there, and both fingers have the same room.
    centred = hands.positions + hands.rotations[:, :, 1] * contacts.centre[:, 1, None]
    hands = HandPoses(hands.rotations, centred)
    free = _free(surface, hands.selected(tried), contacts.width[tried], gripper, parameters)
    chosen = _different(hands, tried[free], count, parameters)
    return tuple(
        ObjectGrasp(_pose(hands, index), float(contacts.width[index]), float(quality[index])) for index in chosen
    )


def _pairs(
    surface: SolidSurface, gripper: GripperModel, rng: np.random.Generator, parameters: AntipodalModelParameters
) -> tuple[NDArray[np.float64], ...]:
    """First contacts (P, 3), unit closing directions (P, 3) and distances (P,) of antipodal pairs."""
    chosen = rng.permutation(len(surface.points))[: parameters.contacts]
    points, inward = surface.points[chosen], -surface.normals[chosen]
    ends, leaving = surface.opposite(points, inward)
    # Where the faces are not parallel, the line half way between their normals is within both cones longest.
    between = inward + leaving
    found = np.isfinite(ends).all(axis=1) & (np.linalg.norm(between, axis=1) > 1.0)
    middle = between[found] / np.linalg.norm(between[found], axis=1)[:, None]
    second_ends, second_leaving = surface.opposite(points[found], middle)
    starts = np.concatenate([points, points[found]])
    starting = np.concatenate([inward, inward[found]])
    lines = np.concatenate([inward, middle])
    ends, leaving = np.concatenate([ends, second_ends]), np.concatenate([leaving, second_leaving])
    widths = np.linalg.norm(ends - starts, axis=1)
    cone = math.cos(math.atan(parameters.friction))
    with np.errstate(invalid="ignore"):
        antipodal = (np.einsum("ij,ij->i", lines, starting) >= cone) & (np.einsum("ij,ij->i", lines, leaving) >= cone)
        antipodal &= (widths > gripper.min_width) & (widths <= gripper.max_width - 2 * parameters.hand.clearance)
    return starts[antipodal], lines[antipodal], widths[antipodal]


def _turned_hands(middles: NDArray[np.float64], closing: NDArray[np.float64], turn: float) -> HandPoses:
    """Hands around each closing axis, the first as far from above as it can be: (P * turns)."""
    down = np.array([0.0, 0.0, -1.0]) + closing * closing[:, 2:3]
    upright = np.linalg.norm(down, axis=1) < 1e-3
    down[upright] = np.array([1.0, 0.0, 0.0])
    down /= np.linalg.norm(down, axis=1)[:, None]
    beside = np.cross(closing, down)
    angles = np.arange(0.0, 2 * math.pi - 1e-9, turn)
    approach = np.cos(angles)[None, :, None] * down[:, None, :] + np.sin(angles)[None, :, None] * beside[:, None, :]
    approach = approach.reshape(-1, 3)
    repeated = np.repeat(closing, len(angles), axis=0)
    rotations = np.stack([np.cross(repeated, approach), repeated, approach], axis=2)
    return HandPoses(rotations, np.repeat(middles, len(angles), axis=0))


def _quality(
    hands: HandPoses,
    contacts: PadContacts,
    centre_of_mass: NDArray[np.float64],
    gripper: GripperModel,
    parameters: AntipodalModelParameters,
) -> NDArray[np.float64]:
    """0 to 1 (K,): cone margin, flat patches against the pads, patches opposite each other, centre of mass near."""
    cone = math.atan(parameters.friction)
    margin = 1.0 - np.arccos(np.clip(contacts.alignment, -1.0, 1.0)) / cone
    flat = np.clip(contacts.extent / (np.array(gripper.pad_size) / math.sqrt(12.0)), 0.0, 1.0)
    opposed = np.exp(-np.square(contacts.offset / (0.4 * gripper.pad_size[0])))
    middles = hands.positions + np.einsum("kij,kj->ki", hands.rotations, contacts.centre)
    arm = centre_of_mass - middles
    arm -= hands.rotations[:, :, 1] * np.einsum("ij,ij->i", arm, hands.rotations[:, :, 1])[:, None]
    # Hanging below the fingers does no harm while it stands as modelled: height counts half.
    near = np.exp(-np.linalg.norm(arm * [1.0, 1.0, 0.5], axis=1) / parameters.mass_arm)
    quality = (0.2 + 0.5 * np.sqrt(margin.clip(0.0)) + 0.3 * flat.mean(axis=1)) * opposed * (0.3 + 0.7 * near)
    fits = (contacts.width > gripper.min_width) & (contacts.bulge < parameters.bulge) & (margin > 0.0)
    fits &= contacts.width <= gripper.max_width - 2 * parameters.hand.clearance
    return np.where(fits, np.clip(quality, 0.0, 1.0), 0.0)


def _free(
    surface: SolidSurface,
    hands: HandPoses,
    widths: NDArray[np.float64],
    gripper: GripperModel,
    parameters: AntipodalModelParameters,
) -> NDArray[np.bool_]:
    """Whether the open hand stays clear of the model (K,)."""
    openings = np.minimum(gripper.max_width, widths + 4 * parameters.hand.clearance)
    clear = HandShape(gripper, parameters.shape).clearances(hands, openings, surface.points, 1.0)
    approach = hands.rotations[:, :, 2]
    nearest = np.array(
        [
            float(((surface.points - position) @ direction).min())
            for position, direction in zip(hands.positions, approach, strict=True)
        ]
    )
    beside_palm = nearest > -gripper.finger_depth + parameters.hand.palm_clearance
    # What stands out farther back than the palm must pass it at the side, with the same clearance.
    palm_free = beside_palm | (clear > parameters.hand.palm_clearance)
    return (clear > parameters.surface_clearance) & palm_free


def _different(
    hands: HandPoses, order: NDArray[np.intp], count: int, parameters: AntipodalModelParameters
) -> list[int]:
    """The first ``count`` of ``order`` that are not near one taken before."""
    chosen: list[int] = []
    for index in order:
        taken = hands.selected(np.array(chosen, dtype=np.intp))
        near = np.linalg.norm(taken.positions - hands.positions[index], axis=1) < parameters.apart
        cosine = (np.einsum("kij,ij->k", taken.rotations, hands.rotations[index]) - 1.0) / 2.0
        if not np.any(near & (np.arccos(np.clip(cosine, -1.0, 1.0)) < parameters.apart_angle)):
            chosen.append(int(index))
            if len(chosen) == count:
                break
    return chosen


def _pose(hands: HandPoses, index: int) -> Pose:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = hands.rotations[index], hands.positions[index]
    return Pose.from_matrix(matrix)
