"""Grasp quality of a closed hand: contacts within their friction cones, size and opposition of the contact patches,
depth.

The score is a logistic regression on the contacts of the pads. Its weights come from random shapes grasped in physics
by a Franka hand (about 400 grasps, good and bad ones, on clouds of two noisy views), rounded; the weight of the lever
arm, which hardly mattered for those light shapes, is set by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.robot_model.model import GripperModel


@dataclass(frozen=True, eq=False)
class PadContacts:
    """Contacts of K closed hands, (K,) each; ``width`` is 0 if a pad touches nothing.

    ``centre``: middle between the contacts, (K, 3) in the tool frame. ``alignment``: cosine between closing direction
    and mean normal of the patch, at the worse side. ``extent``: (K, 2) spread of the smaller patch across and along the
    pads, metres (standard deviation). ``offset``: metres between the patches, along the pads' faces. ``bulge``: metres
    by which the object is wider between the fingers above the pads.
    """

    width: NDArray[np.float64]
    centre: NDArray[np.float64]
    alignment: NDArray[np.float64]
    extent: NDArray[np.float64]
    offset: NDArray[np.float64]
    bulge: NDArray[np.float64]


def close_pads(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    hands: HandPoses,
    openings: NDArray[np.float64],
    pad_size: tuple[float, float],
    finger_depth: float,
    patch_depth: float,
) -> PadContacts:
    """Return the contacts of flat pads that close on the surface samples ``points``, ``normals`` (N, 3).

    ``patch_depth``: metres behind the first contact within which a sample counts as touching: compliance of the pad and
    noise of the samples.
    """
    count = len(hands)
    result = PadContacts(
        width=np.zeros(count),
        centre=np.zeros((count, 3)),
        alignment=np.full(count, -1.0),
        extent=np.zeros((count, 2)),
        offset=np.zeros(count),
        bulge=np.zeros(count),
    )
    for part in hands.passes(len(points)):
        chunk = hands.selected(part)
        x, y, z = chunk.local(points)
        between = (np.abs(x) <= pad_size[0] / 2) & (np.abs(y) <= openings[part, None] / 2)
        between &= (z <= pad_size[1] / 2) & (z > -finger_depth)
        hand, sample = np.nonzero(between)
        x, y, z = x[between], y[between], z[between]
        at_pads = z >= -pad_size[1] / 2
        facing = np.einsum("ij,ijk->ik", normals[sample], chunk.rotations[hand])
        sides = [
            _side(sign, len(chunk), hand, np.stack([x, y, z], axis=1), facing, at_pads, patch_depth)
            for sign in (1.0, -1.0)
        ]
        (reach, middle, spread, cosine, bulge), (other, other_middle, other_spread, *others) = sides
        met = np.isfinite(reach) & np.isfinite(other)
        index = np.arange(count)[part][met]
        result.width[index] = reach[met] + other[met]
        result.centre[index, 1] = (reach[met] - other[met]) / 2
        result.centre[index, ::2] = (middle + other_middle)[met] / 2
        result.alignment[index] = np.minimum(cosine, others[0])[met]
        result.extent[index] = np.minimum(spread, other_spread)[met]
        result.offset[index] = np.linalg.norm(middle - other_middle, axis=1)[met]
        result.bulge[index] = np.maximum(np.maximum(bulge, others[1])[met], 0.0)
    return result


def _side(
    sign: float,
    count: int,
    hand: NDArray[np.intp],
    local: NDArray[np.float64],
    facing: NDArray[np.float64],
    at_pads: NDArray[np.bool_],
    patch_depth: float,
) -> tuple[NDArray[np.float64], ...]:
    """One pad of each of ``count`` hands on the samples between its fingers, given with the hand that they belong to.

    How far out it stops (-inf: it meets nothing), middle and spread of its patch (across, along), cosine of the mean
    normal, and how much farther the object reaches above.
    """
    out = sign * local[:, 1]
    reach, above = np.full(count, -np.inf), np.full(count, -np.inf)
    np.maximum.at(reach, hand[at_pads], out[at_pads])
    np.maximum.at(above, hand[~at_pads], out[~at_pads])
    patch = at_pads & (out >= reach[hand] - patch_depth)
    owner, across = hand[patch], local[patch][:, [0, 2]]
    number = np.maximum(np.bincount(owner, minlength=count), 1)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = [np.bincount(owner, column, count) / number for column in values.T]
        return np.stack(columns, axis=1)

    middle = mean(across)
    spread = np.sqrt(np.maximum(mean(across**2) - middle**2, 0.0))
    normal = mean(facing[patch])
    cosine = sign * normal[:, 1] / np.maximum(np.linalg.norm(normal, axis=1), 1e-9)
    with np.errstate(invalid="ignore"):
        bulge = above - reach
    return reach, middle, spread, cosine, bulge


@dataclass(frozen=True)
class ContactQuality:
    """Estimates the probability that a grasp holds, from the contacts of the pads.

    Weights of the log-odds. ``bias``: of an ideal grasp. ``angle``: per radian between closing direction and the
    patch's normal, at the worse side. ``across``, ``along``: of the smaller patch's spread relative to the pad's, 0 to
    1. ``offset``: per pad width between the two patches. ``tip``: of the contact beyond the middle of the pads, as a
    fraction of half a pad. ``wide``: of the width beyond three quarters of the opening, as a fraction of the rest.
    ``arm``: per metre between the closing axis and the centre of mass; vertical distance is weighted by
    ``hanging_share``, since weight below the fingers causes little torque.
    """

    bias: float = 3.7
    angle: Annotated[float, "1/rad"] = -2.4
    across: float = 0.5
    along: float = 1.2
    offset: float = -1.2
    tip: float = -3.0
    wide: float = -0.8
    arm: Annotated[float, "1/m"] = -15.0
    hanging_share: float = 0.3

    def judge(
        self,
        hands: HandPoses,
        contacts: PadContacts,
        centre_of_mass: NDArray[np.float64],
        gripper: GripperModel,
        *,
        widest: float,
        friction: float,
        bulge: float,
    ) -> NDArray[np.float64]:
        """Return the quality, 0 to 1, of each of K hands (K,).

        ``centre_of_mass``: (3,) in the frame of the hands, whose z points up. The quality is 0 if the object is wider
        than ``widest`` metres, if the angle between closing direction and normal exceeds the cone of ``friction`` (its
        tangent), or if the object is wider by ``bulge`` metres between the fingers above the pads.
        """
        angle = np.arccos(np.clip(contacts.alignment, -1.0, 1.0))
        spread = np.clip(contacts.extent / (np.array(gripper.part.pad_size) / math.sqrt(12.0)), 0.0, 1.0)
        closing = hands.rotations[:, :, 1]
        middles = hands.positions + np.einsum("kij,kj->ki", hands.rotations, contacts.centre)
        arm = centre_of_mass - middles
        arm -= closing * np.einsum("ij,ij->i", arm, closing)[:, None]
        log_odds = (
            self.bias
            + self.angle * angle
            + spread @ np.array([self.across, self.along])
            + self.offset * np.minimum(contacts.offset / gripper.part.pad_size[0], 1.0)
            + self.tip * np.maximum(contacts.centre[:, 2], 0.0) / (gripper.part.pad_size[1] / 2)
            + self.wide * np.maximum(contacts.width / gripper.max_width - 0.75, 0.0) / 0.25
            + self.arm * np.linalg.norm(arm * [1.0, 1.0, self.hanging_share], axis=1)
        )
        fits = (contacts.width > gripper.part.min_width) & (contacts.width <= widest)
        fits &= (contacts.bulge < bulge) & (angle < math.atan(friction))
        return np.where(fits, 1.0 / (1.0 + np.exp(-log_odds)), 0.0)
