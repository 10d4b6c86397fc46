"""Where the hand goes for a given pair of contacts: how deep the fingers may reach, and the poses before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class HandPlacement:
    """Where the hand stands for a grasp.

    Metres.

    ``clearance``: between each finger and the object before closing; ``least_clearance``: the same for objects so wide
    that the hand cannot open farther. ``max_depth``: of the tool frame below the object's top, less where the palm
    would touch it; ``palm_clearance``: between palm and object.
    ``support_clearance``: between fingers (from above) or hand (from the side) and the surface;
    ``least_support_clearance``: the same from above, for objects so flat that the fingers would pass over them.
    ``hand_half_thickness``: of the hand across the closing direction. ``approach_distance``: from pre-grasp to grasp.
    ``lift_height``: from grasp to lift.
    """

    clearance: Annotated[float, "m"] = 0.005
    least_clearance: Annotated[float, "m"] = 0.0035
    max_depth: Annotated[float, "m"] = 0.030
    palm_clearance: Annotated[float, "m"] = 0.008
    support_clearance: Annotated[float, "m"] = 0.006
    least_support_clearance: Annotated[float, "m"] = 0.003
    hand_half_thickness: Annotated[float, "m"] = 0.035
    approach_distance: Annotated[float, "m"] = 0.10
    lift_height: Annotated[float, "m"] = 0.12

    def fits(self, width: float, gripper: GripperModel) -> bool:
        """Whether the gripper opens wide enough for ``width`` and can close on it."""
        return gripper.part.min_width < width <= self.widest(gripper)

    def widest(self, gripper: GripperModel) -> float:
        """How wide an object may be, metres."""
        return gripper.max_width - 2 * self.least_clearance

    def openings(self, widths: NDArray[np.float64], gripper: GripperModel) -> NDArray[np.float64]:
        """How far to open (K,) before the approach to objects of ``widths`` (K,), metres."""
        return np.minimum(gripper.max_width, widths + 4 * self.clearance)

    def reach(self, gripper: GripperModel) -> float:
        """How far an object may stand out from the tool frame towards the palm."""
        return min(self.max_depth, gripper.part.finger_depth - self.palm_clearance)

    def top_height(self, top: float, support_height: float, gripper: GripperModel) -> float | None:
        """z of the tool frame for a grasp from above an object with its top at ``top``; None where too flat."""
        half_pad = gripper.part.pad_size[1] / 2
        lowest = support_height + half_pad + self.support_clearance
        least = support_height + half_pad + self.least_support_clearance
        highest = top - 0.4 * half_pad
        if highest < least:
            return None
        return max(top - self.reach(gripper), min(lowest, highest))

    def candidate(
        self,
        position: NDArray[np.float64],
        approach: NDArray[np.float64],
        closing: NDArray[np.float64],
        width: float,
        quality: float,
        kind: str,
        gripper: GripperModel,
    ) -> GraspCandidate:
        """Build the poses; ``approach`` (tool z) and ``closing`` (tool y) are unit and orthogonal, (3,)."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([np.cross(closing, approach), closing, approach], axis=1)
        matrix[:3, 3] = position
        grasp = Pose.from_matrix(matrix)
        before = Pose(position - self.approach_distance * approach, grasp.quaternion)
        lift = Pose(position + np.array([0.0, 0.0, self.lift_height]), grasp.quaternion)
        opening = min(gripper.max_width, width + 4 * self.clearance)
        return GraspCandidate(grasp, before, lift, width, opening, float(np.clip(quality, 0.0, 1.0)), kind)
