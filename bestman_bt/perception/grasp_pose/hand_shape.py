"""An open parallel hand as three boxes, for clearances from the object, its surroundings and the support."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses
from bestman_bt.robot_model.model import GripperModel


@dataclass(frozen=True)
class HandPlacement:
    """Clearances that determine the pose of the hand for a grasp.

    Metres.

    ``clearance``: between each finger and the object before closing; ``least_clearance``: the same for objects so wide
    that the hand cannot open farther. ``max_depth``: of the tool frame below the object's top, less if the palm would
    touch it; ``palm_clearance``: between palm and object. ``support_clearance``: between fingers (from above) or hand
    (from the side) and the surface; ``least_support_clearance``: the same from above, for objects so flat that the
    fingers would pass over them. ``hand_half_thickness``: of the hand across the closing direction.
    ``approach_distance``: from pre-grasp to grasp. ``lift_height``: from grasp to lift.
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
        """Return whether the gripper opens wide enough for ``width`` and can close on it."""
        return gripper.part.min_width < width <= self.widest(gripper)

    def widest(self, gripper: GripperModel) -> float:
        """Return the largest width of an object, metres."""
        return gripper.max_width - 2 * self.least_clearance

    def openings(self, widths: NDArray[np.float64], gripper: GripperModel) -> NDArray[np.float64]:
        """Return the finger openings (K,) before the approach to objects of ``widths`` (K,), metres."""
        return np.minimum(gripper.max_width, widths + 4 * self.clearance)

    def reach(self, gripper: GripperModel) -> float:
        """Return the maximum distance, metres, by which an object may extend from the tool frame towards the palm."""
        return min(self.max_depth, gripper.part.finger_depth - self.palm_clearance)

    def top_height(self, top: float, support_height: float, gripper: GripperModel) -> float | None:
        """Return z of the tool frame, metres, for a top grasp of an object whose top is at ``top``, or None if it is
        too flat.
        """
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


@dataclass(frozen=True)
class HandSize:
    """Dimensions of a hand that are not part of its GripperModel.

    Metres; the defaults are those of a Franka hand. Opening, depth and pads are in the GripperModel.
    ``finger_thickness``: from the pad outwards. ``palm_size``: full (across, along) the closing direction.
    ``palm_length``: behind the palm, including the room for a straight approach.
    """

    finger_thickness: Annotated[float, "m"] = 0.024
    palm_size: Annotated[tuple[float, float], "m"] = (0.070, 0.210)
    palm_length: Annotated[float, "m"] = 0.200


@dataclass(frozen=True)
class HandShape:
    """The fingers of ``gripper``, opened, and the palm ``depth`` metres behind the tool (the gripper's by default)."""

    gripper: GripperModel
    size: HandSize
    depth: float | None = None

    @property
    def _depth(self) -> float:
        return self.gripper.part.finger_depth if self.depth is None else self.depth

    @property
    def reach(self) -> float:
        """Return the largest distance of any part from the tool frame at full opening, metres."""
        palm, depth = self.size.palm_size, self._depth
        side = max(palm[1] / 2, self.gripper.max_width / 2 + self.size.finger_thickness)
        return float(np.linalg.norm([palm[0] / 2, side, depth + self.size.palm_length]))

    def boxes(self, openings: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return centres and half sizes (K, 3, 3) of two fingers and the palm in the tool frame, metres, for openings
        (K,).
        """
        thickness, palm = self.size.finger_thickness, self.size.palm_size
        pad_width, pad_height = self.gripper.part.pad_size
        depth, length = self._depth, self.size.palm_length
        centres = np.zeros((len(openings), 3, 3))
        centres[:, 0, 1] = (openings + thickness) / 2
        centres[:, 1, 1] = -centres[:, 0, 1]
        centres[:, :2, 2] = (pad_height / 2 - depth) / 2
        centres[:, 2, 2] = -depth - length / 2
        finger = [pad_width / 2, thickness / 2, (pad_height / 2 + depth) / 2]
        halves = np.array([finger, finger, [palm[0] / 2, palm[1] / 2, length / 2]])
        return centres, np.broadcast_to(halves, centres.shape)

    def clearances(
        self, hands: HandPoses, openings: NDArray[np.float64], points: NDArray[np.float64], enough: float = np.inf
    ) -> NDArray[np.float64]:
        """Return the distance (K,), metres, from each open hand to the nearest of ``points`` (N, 3); 0 if one is inside
        it.

        ``enough``: upper limit of the result, also returned without points.
        """
        result = np.full(len(hands), enough)
        if not len(points):
            return result
        centres, halves = self.boxes(openings)
        for part in hands.passes(len(points)):
            local = hands.selected(part).local(points)
            for box in range(3):
                squared = np.zeros_like(local[0])
                for axis in range(3):
                    outside = np.abs(local[axis] - centres[part, box, axis, None]) - halves[part, box, axis, None]
                    squared += np.square(np.maximum(outside, 0.0))
                result[part] = np.minimum(result[part], np.sqrt(squared.min(axis=1)))
        return result

    def touches(
        self, hands: HandPoses, openings: NDArray[np.float64], points: NDArray[np.float64], margin: float
    ) -> NDArray[np.bool_]:
        """Return whether one of ``points`` (N, 3) lies in a box of the open hand, enlarged by ``margin`` metres, (K,)
        bool.
        """
        result = np.zeros(len(hands), dtype=bool)
        centres, halves = self.boxes(openings)
        for part in hands.passes(len(points)):
            x, y, z = hands.selected(part).local(points)
            x, y = np.abs(x), np.abs(y)
            # The two fingers are alike, so one box and |y| do.
            for box in (0, 2):
                half = halves[part, box, :, None] + margin
                inside = x < half[:, 0]
                inside &= np.abs(y - centres[part, box, 1, None]) < half[:, 1]
                inside &= np.abs(z - centres[part, box, 2, None]) < half[:, 2]
                result[part] |= inside.any(axis=1)
        return result

    def outline(self, hands: HandPoses, opening: float, step: float = 0.008) -> NDArray[np.float64]:
        """Return points (N, 3) about ``step`` metres apart on the boxes of the first of ``hands``, in its frame."""
        centres, halves = self.boxes(np.array([opening]))
        points = []
        for centre, half in zip(centres[0], halves[0], strict=True):
            counts = np.maximum(np.ceil(2 * half / step).astype(int) + 1, 2)
            axes = [np.linspace(-extent, extent, count) for extent, count in zip(half, counts, strict=True)]
            grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            points.append(centre + grid[np.any(np.isclose(np.abs(grid), half), axis=1)])
        outline: NDArray[np.float64] = np.concatenate(points) @ hands.rotations[0].T + hands.positions[0]
        return outline

    def lowest(self, hands: HandPoses, openings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return z (K,) of the lowest corner of each open hand, metres in the frame of the poses."""
        centres, halves = self.boxes(openings)
        row = hands.rotations[:, None, 2, :]
        heights = (row * centres).sum(axis=2) - (np.abs(row) * halves).sum(axis=2)
        lowest: NDArray[np.float64] = hands.positions[:, 2] + heights.min(axis=1)
        return lowest
