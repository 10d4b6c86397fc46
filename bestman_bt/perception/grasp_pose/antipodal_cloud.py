"""Antipodal grasps on the measured cloud of an unknown object, with the hand checked against all that is known.

Pairs of points whose normals oppose each other within friction cones (Nguyen 1988), and lines through the middle,
give closing axes; hands turned about them are closed on the cloud and ranked by what the pads meet, as ten Pas et al.
("Grasp Pose Detection in Point Clouds", 2017) rank theirs by what lies between the fingers, without a network.
The sides that no camera saw are assumed: see CloudCompletion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.clearance import surroundings_of
from bestman_bt.perception.grasp_pose.completed_cloud import CloudCompletion, CompletedCloud
from bestman_bt.perception.grasp_pose.contact_quality import ContactQuality
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacement
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands, hands_about
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize
from bestman_bt.perception.grasp_pose.pad_contact import PadContacts, close_pads
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class AntipodalCloud(GraspPlanner):
    """Grasps of an unknown object by its measured cloud. Raises PerceptionError for targets without one.

    Metres and radians.

    ``contacts``: points tried as a contact; ``pairs``: closing axes kept of those that they make. ``friction``: tangent
    of the cones in which a pair must lie, wide, since normals are noisy; ``contact_friction``: the same for what the
    pads then meet, which quality judges. ``bulge``: by how much the object may be wider between the fingers above the
    pads. ``max_slope``: of a closing axis.
    ``yaws``, ``beside``: level closing axes tried through the middle and as far to both sides of it.
    ``tilts``: of the approach about the closing axis, from as far above as can be; ``tilt_weight``: share of the
    quality that a tilt of 45° costs.
    ``patch_depth``: noise of the cloud and give of the pads. ``object_clearance``, ``surroundings_clearance``,
    ``support_clearance``: of the open hand. ``apart``, ``apart_angle``: two grasps nearer than both count as one.
    """

    contacts: int = 320
    pairs: int = 120
    friction: float = 0.6
    contact_friction: float = 0.9
    bulge: Annotated[float, "m"] = 0.008
    max_slope: Annotated[float, "rad"] = math.radians(35.0)
    yaws: int = 18
    beside: Annotated[float, "m"] = 0.015
    tilts: Annotated[tuple[float, ...], "rad"] = (
        0.0,
        math.radians(20.0),
        math.radians(-20.0),
        math.radians(40.0),
        math.radians(-40.0),
    )
    tilt_weight: float = 0.10
    patch_depth: Annotated[float, "m"] = 0.003
    object_clearance: Annotated[float, "m"] = 0.003
    surroundings_clearance: Annotated[float, "m"] = 0.005
    support_clearance: Annotated[float, "m"] = 0.004
    apart: Annotated[float, "m"] = 0.010
    apart_angle: Annotated[float, "rad"] = math.radians(15.0)
    max_candidates: int = 80
    cloud: CloudCompletion = field(default_factory=CloudCompletion)
    quality: ContactQuality = field(default_factory=ContactQuality)
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """See GraspPlanner; empty for a cloud of too few points."""
        if target.cloud is None:
            raise PerceptionError(
                "AntipodalCloud needs a target with a cloud; for a box alone there is a plug-in, bounding_box_grasps.py"
            )
        cloud = self.cloud.complete(target.cloud, target.viewpoints, support_height)
        if cloud is None:
            return ()
        # For the object the palm begins where the hand may reach no further over it, a little before its true place.
        reach = self.hand.reach(gripper) + self.object_clearance + 1e-6
        shape = HandShape(gripper, self.shape, reach)
        hands = self._hands(cloud, gripper, shape, support_height)
        contacts = close_pads(
            cloud.points,
            cloud.normals,
            hands,
            np.full(len(hands), gripper.max_width),
            gripper.part.pad_size,
            gripper.part.finger_depth,
            self.patch_depth,
        )
        hands = hands.shifted(contacts.centre[:, 1], 1)
        quality = self._quality(hands, contacts, cloud, gripper)
        order = np.argsort(-quality, kind="stable")
        order = order[quality[order] > 0.0]
        openings = self.hand.openings(contacts.width, gripper)
        tried = hands.selected(order)
        lowest = shape.lowest(tried, openings[order]) - support_height
        free = ~shape.touches(tried, openings[order], cloud.points, self.object_clearance)
        free &= lowest >= self.support_clearance - 1e-6
        others = surroundings_of(target, support_height, shape.reach + float(np.ptp(cloud.points, axis=0).max()))
        around = shape.clearances(tried, openings[order], others)
        free &= around > self.surroundings_clearance
        clearances = np.zeros(len(hands))
        clearances[order] = np.minimum(around, lowest)
        chosen = different_hands(hands, order[free], self.max_candidates, self.apart, self.apart_angle)
        return tuple(
            self._candidate(hands.pose(index), contacts.width[index], quality[index], clearances[index], gripper)
            for index in chosen
        )

    def _hands(
        self, cloud: CompletedCloud, gripper: GripperModel, shape: HandShape, support_height: float
    ) -> HandPoses:
        """Tilted hands on all closing axes, each as deep as palm and support allow, and at the axis itself."""
        middles, closing = self._closing_axes(cloud, gripper)
        hands = hands_about(middles, closing, np.array(self.tilts))
        wide_open = np.full(len(hands), gripper.max_width)
        room = np.full(len(hands), np.inf)
        palm = np.array(self.shape.palm_size) / 2
        for part in hands.passes(len(cloud.points)):
            x, y, z = hands.selected(part).local(cloud.points)
            below_palm = (np.abs(x) < palm[0]) & (np.abs(y) < palm[1])
            room[part] = np.where(below_palm, z, np.inf).min(axis=1) + self.hand.reach(gripper)
        descent = np.maximum(-hands.rotations[:, 2, 2], 0.2)
        above = shape.lowest(hands, wide_open) - support_height - self.support_clearance
        deepest = np.minimum(room, above / descent)
        usable = np.isfinite(deepest)
        hands, deepest = hands.selected(usable), deepest[usable]
        at_axis = np.minimum(deepest, 0.0)
        deep, level = hands.shifted(deepest, 2), hands.shifted(at_axis, 2).selected(deepest > 0.004)
        return HandPoses(
            np.concatenate([deep.rotations, level.rotations]), np.concatenate([deep.positions, level.positions])
        )

    def _closing_axes(
        self, cloud: CompletedCloud, gripper: GripperModel
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Middles and unit directions (A, 3) along which the hand might close."""
        chosen = np.linspace(0, len(cloud.points) - 1, min(len(cloud.points), self.contacts)).astype(np.intp)
        points, normals = cloud.points[chosen], cloud.normals[chosen]
        lines = points[None] - points[:, None]
        lengths = np.linalg.norm(lines, axis=2)
        safe = np.maximum(lengths, 1e-9)
        leaving = -np.einsum("ijk,ik->ij", lines, normals) / safe
        arriving = np.einsum("ijk,jk->ij", lines, normals) / safe
        cone = math.cos(math.atan(self.friction))
        fits = (lengths > max(gripper.part.min_width, 0.004)) & (lengths <= self.hand.widest(gripper))
        level = np.abs(lines[:, :, 2]) <= math.sin(self.max_slope) * safe
        first, second = np.nonzero(np.triu((leaving > cone) & (arriving > cone) & fits & level, 1))
        middles = (points[first] + points[second]) / 2
        axes = lines[first, second] / lengths[first, second][:, None]
        axes *= np.where((axes[:, 0] > 0) | ((axes[:, 0] == 0) & (axes[:, 1] > 0)), 1.0, -1.0)[:, None]
        from_middle = np.linalg.norm(middles - cloud.centre_of_mass, axis=1)
        score = np.minimum(leaving[first, second], arriving[first, second]) - 8.0 * from_middle
        order = np.argsort(-score, kind="stable")
        # One pair of each kind: middles in the same 8 mm, directions within about 12 degrees.
        kinds = np.round(np.column_stack([middles / 0.008, axes / 0.2])).astype(np.int64)[order]
        _, once = np.unique(kinds, axis=0, return_index=True)
        kept = order[np.sort(once)[: self.pairs]]
        angles = np.arange(self.yaws) * math.pi / self.yaws
        level_axes = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(self.yaws)])
        across = np.column_stack([-np.sin(angles), np.cos(angles), np.zeros(self.yaws)])
        swept = [cloud.centre_of_mass + step * across for step in (-self.beside, 0.0, self.beside)]
        return np.concatenate([middles[kept], *swept]), np.concatenate([axes[kept], *[level_axes] * 3])

    def _quality(
        self, hands: HandPoses, contacts: PadContacts, cloud: CompletedCloud, gripper: GripperModel
    ) -> NDArray[np.float64]:
        widest = self.hand.widest(gripper)
        quality = self.quality.judge(
            hands,
            contacts,
            cloud.centre_of_mass,
            gripper,
            widest=widest,
            friction=self.contact_friction,
            bulge=self.bulge,
        )
        tilt = np.arccos(np.clip(-hands.rotations[:, 2, 2], -1.0, 1.0))
        return quality * (1.0 - self.tilt_weight * tilt / (math.pi / 4))

    def _candidate(
        self, tool: Pose, width: float, quality: float, clearance: float, gripper: GripperModel
    ) -> GraspCandidate:
        rotation = tool.rotation
        kind = "top" if rotation[2, 2] < -math.cos(math.pi / 4) else "side"
        candidate = self.hand.candidate(
            tool.position, rotation[:, 2], rotation[:, 1], float(width), float(quality), kind, gripper
        )
        return replace(candidate, clearance=float(clearance))
