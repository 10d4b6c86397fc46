"""How likely a closed hand holds: contacts within their friction cones, broad patches that face each other, deep.

The score is a logistic regression on what the pads meet. Its weights come from random shapes grasped in physics by a
Franka hand (about 400 grasps, good and bad ones, on clouds of two noisy views), rounded; the arm of the weight, which
hardly mattered for those light shapes, is set by hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.perception.grasp_pose.pad_contact import PadContacts
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class ContactQuality:
    """Tells how likely a grasp holds, by what the pads meet.

    Weights of the log-odds.

    ``angle``: per radian between closing direction and the patch's normal, at the worse side. ``across``, ``along``: of
    the smaller patch's spread over the pad's, 0 to 1. ``offset``: per width of a pad between the two patches. ``tip``:
    of the contact beyond the middle of the pads, as a share of half a pad. ``wide``: of the width beyond three quarters
    of the opening, as a share of what is left. ``arm``: per metre between the closing axis and the centre of mass;
    height counts by ``hanging_share``, since weight that hangs below the fingers turns nothing.
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
        """0 to 1 for each of K hands (K,).

        ``centre_of_mass``: (3,) in the frame of the hands, whose z points up. It is 0 where the object is wider than
        ``widest`` metres, the angle between closing direction and normal beyond the cone of ``friction`` (its
        tangent), or the object wider by ``bulge`` metres between the fingers above the pads.
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
