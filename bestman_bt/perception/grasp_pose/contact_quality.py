"""How well a closed hand holds: friction cones, flat patches that face each other, the weight near the closing axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.perception.grasp_pose.pad_contact import PadContacts
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class ContactQualityParameters:
    """``friction``: of the cones, tangent of the half angle. Metres: ``bulge``: by how much the object may be wider
    between the fingers above the pads. ``mass_arm``: between the centre of mass and the closing axis, at which that
    term falls to 1/e; height counts by ``hanging_share``, since weight that hangs below the fingers turns nothing.
    ``offset``: between the two patches, likewise.
    """

    friction: float = 0.35
    bulge: float = 0.004
    mass_arm: float = 0.06
    hanging_share: float = 0.5
    offset: float = 0.008


def contact_quality(
    hands: HandPoses,
    contacts: PadContacts,
    centre_of_mass: NDArray[np.float64],
    gripper: GripperModel,
    widest: float,
    parameters: ContactQualityParameters,
) -> NDArray[np.float64]:
    """0 to 1 for each of K hands (K,); 0: it does not hold, or the object is wider than ``widest`` metres.

    ``centre_of_mass``: (3,) in the frame of the hands, whose z points up.
    """
    cone = math.atan(parameters.friction)
    margin = 1.0 - np.arccos(np.clip(contacts.alignment, -1.0, 1.0)) / cone
    flat = np.clip(contacts.extent / (np.array(gripper.pad_size) / math.sqrt(12.0)), 0.0, 1.0)
    opposed = np.exp(-np.square(contacts.offset / parameters.offset))
    closing = hands.rotations[:, :, 1]
    middles = hands.positions + np.einsum("kij,kj->ki", hands.rotations, contacts.centre)
    arm = centre_of_mass - middles
    arm -= closing * np.einsum("ij,ij->i", arm, closing)[:, None]
    near = np.exp(-np.linalg.norm(arm * [1.0, 1.0, parameters.hanging_share], axis=1) / parameters.mass_arm)
    quality = (0.2 + 0.5 * np.sqrt(margin.clip(0.0)) + 0.3 * flat.mean(axis=1)) * opposed * (0.3 + 0.7 * near)
    fits = (contacts.width > gripper.min_width) & (contacts.width <= widest)
    fits &= (contacts.bulge < parameters.bulge) & (margin > 0.0)
    return np.where(fits, np.clip(quality, 0.0, 1.0), 0.0)
