"""Antipodal grasps on the measured cloud of an unknown object, with the hand checked against all known obstacles.

Pairs of points whose normals oppose each other within friction cones (Nguyen 1988), and lines through the middle, give
closing axes; hands rotated about them are closed on the cloud and ranked by the contacts of the pads, similar to ten
Pas et al. ("Grasp Pose Detection in Point Clouds", 2017), who rank grasps by the points between the fingers, but
without a network. Sides not seen by any camera are assumed: see CloudCompletion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_erosion, gaussian_filter
from scipy.spatial import cKDTree

from bestman_bt.messages import PointCloud, Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.contact_quality import ContactQuality, PadContacts, close_pads
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands, hands_about
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import surroundings_of
from bestman_bt.robot_model.model import GripperModel

# A measured cloud made fit for grasping: smoothed, with normals, and with the sides that no camera saw.
# Normals by principal components (Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992), oriented
# towards the cameras that saw the point. What was not seen is taken to go straight down to the support from what was:
# true for walls, and for overhangs right about the outline, which is what a hand from above meets.


@dataclass(frozen=True)
class CloudCompletion:
    """Smooths the cloud of an object and adds the sides that no camera saw.

    Metres. ``voxel``: size of the voxel filter, coarser if more than ``max_points`` would remain. ``neighbours``:
    points within ``radius`` from which a normal is estimated. ``cell``: cell size of the plan view in which the outline
    is found, at least half of the gaps between points; ``column_step``: between the points assumed below it.
    ``around``: number of neighbours to which the surface is connected, the point itself included; ``bridge``: between
    the points assumed on these connections. ``least``: minimum points of an object.
    """

    voxel: Annotated[float, "m"] = 0.004
    max_points: int = 700
    neighbours: int = 20
    radius: Annotated[float, "m"] = 0.014
    cell: Annotated[float, "m"] = 0.005
    column_step: Annotated[float, "m"] = 0.006
    around: int = 9
    bridge: Annotated[float, "m"] = 0.010
    least: int = 25

    def complete(
        self, cloud: PointCloud, viewpoints: NDArray[np.float64] | None, support_height: float
    ) -> CompletedCloud | None:
        """Return the completed cloud, or None if too few finite points are above the support."""
        points = cloud.points[np.isfinite(cloud.points).all(axis=1)]
        points = points[points[:, 2] > support_height]
        voxel = self.voxel
        thinned = _thinned(points, voxel)
        while len(thinned) > self.max_points:
            voxel *= 1.15
            thinned = _thinned(points, voxel)
        if len(thinned) < self.least:
            return None
        gap = float(np.median(cKDTree(points).query(thinned, k=5)[0][:, -1]))
        points, normals = self._smoothed(points, thinned)
        # Where cells are smaller than the gaps between points, each point would be a pillar with walls of its own.
        apart = float(np.median(cKDTree(points[:, :2]).query(points[:, :2], k=self.around)[0][:, -1]))
        centre, walls, wall_normals = self._walls(points, support_height, max(self.cell, apart / 2))
        normals *= _signs(points, normals, viewpoints, centre)[:, None]
        points, normals = np.concatenate([points, walls]), np.concatenate([normals, wall_normals])
        return CompletedCloud(points, normals, centre, self._bridged(points), max(0.0, gap - self.voxel))

    def _bridged(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points with more on the lines to their neighbours, so that no finger passes between them."""
        distances, index = cKDTree(points).query(points, k=self.around)
        first, column = np.nonzero((distances > self.bridge) & (distances < 3.0 * np.median(distances[:, -1])))
        ends, counts = index[first, column], np.ceil(distances[first, column] / self.bridge).astype(np.intp)
        step = np.concatenate([np.arange(1, count) / count for count in counts]) if len(counts) else np.zeros(0)
        first, ends = np.repeat(first, counts - 1), np.repeat(ends, counts - 1)
        return np.concatenate([points, points[first] + step[:, None] * (points[ends] - points[first])])

    def _smoothed(
        self, points: NDArray[np.float64], thinned: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return ``thinned`` projected onto the planes through their neighbours among all ``points``, and these planes'
        normals.
        """
        count = min(self.neighbours, len(points))
        distances, index = cKDTree(points).query(thinned, k=count, distance_upper_bound=self.radius)
        near = np.isfinite(distances)
        neighbours = points[np.where(near, index, 0)]
        weights = near / near.sum(axis=1, keepdims=True)
        means = (weights[:, :, None] * neighbours).sum(axis=1)
        spread = (neighbours - means[:, None]) * np.sqrt(weights)[:, :, None]
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread))
        normals = vectors[:, :, 0]
        # A plane is known where the points spread over two directions; else the point stays.
        known = (near.sum(axis=1) >= 5) & (values[:, 1] > 1e-7)
        offsets = np.einsum("ij,ij->i", thinned - means, normals) * known
        return thinned - normals * offsets[:, None], normals

    def _walls(
        self, points: NDArray[np.float64], support_height: float, cell: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the centre of mass (3,), and points and normals (M, 3) of walls from the outline down
        to the support.
        """
        border = 3
        origin = points[:, :2].min(axis=0) - border * cell
        cells = np.floor((points[:, :2] - origin) / cell).astype(np.intp)
        shape = tuple(cells.max(axis=0) + border + 1)
        tops = np.full(shape, support_height)
        np.maximum.at(tops, (cells[:, 0], cells[:, 1]), points[:, 2])
        measured = tops > support_height
        filled = binary_closing(measured, np.ones((3, 3)), iterations=2) | measured
        tops[filled & ~measured] = float(np.median(tops[measured]))
        heights = np.where(filled, tops - support_height, 0.0)
        x, y = np.nonzero(filled)
        weights = heights[x, y]
        plan = origin + (np.column_stack([x, y]) + 0.5) * cell
        centre = np.append(weights @ plan, weights @ (support_height + weights / 2)) / weights.sum()
        outline = filled & ~binary_erosion(filled)
        slope = np.stack(np.gradient(-gaussian_filter(filled.astype(float), 1.5)), axis=2)
        x, y = np.nonzero(outline & measured)
        outward = slope[x, y]
        length = np.linalg.norm(outward, axis=1)
        x, y, outward, length = (values[length > 1e-6] for values in (x, y, outward, length))
        levels = np.arange(support_height + self.column_step / 2, float(tops.max()), self.column_step)
        column, level = np.nonzero(levels[None, :] < tops[x, y][:, None] - self.column_step)
        wall = np.column_stack([origin + (np.column_stack([x, y])[column] + 0.5) * cell, levels[level]])
        normals = np.column_stack([(outward / length[:, None])[column], np.zeros(len(column))])
        return centre, wall, normals


@dataclass(frozen=True, eq=False)
class CompletedCloud:
    """A smoothed and completed cloud. ``points``, ``normals``: (N, 3) outward, the measured ones first, then the
    assumed ones.

    ``centre_of_mass``: (3,), for uniform density below the visible surface. ``bridged``: (M, 3), the points and further
    ones in the gaps between them, which a hand must not touch. ``unseen``: metres by which the object may extend beyond
    its points.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    centre_of_mass: NDArray[np.float64]
    bridged: NDArray[np.float64]
    unseen: float


def _thinned(points: NDArray[np.float64], voxel: float) -> NDArray[np.float64]:
    """Return the mean of the points in each voxel."""
    if not len(points):
        return points
    _, cell, counts = np.unique(
        np.floor(points / voxel).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, cell.ravel(), points)
    return sums / counts[:, None]


def _signs(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    viewpoints: NDArray[np.float64] | None,
    centre: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return +1 or -1 (N,) for the outside of each point: the side of the camera that saw it, else away from the
    middle.
    """
    outward = points - centre
    if viewpoints is not None:
        towards = np.zeros_like(points)
        for viewpoint in np.asarray(viewpoints, dtype=float).reshape(-1, 3):
            rays = viewpoint - points
            ranges = np.linalg.norm(rays, axis=1)
            directions = rays / ranges[:, None]
            # Seen, if nothing lies clearly in front along the same ray.
            _, others = cKDTree(directions).query(directions, k=min(8, len(points)))
            hidden = ranges > ranges[others].min(axis=1) + 0.015
            towards += np.where(hidden[:, None], 0.0, directions)
        outward = np.where(np.linalg.norm(towards, axis=1)[:, None] > 1e-6, towards, outward)
    return np.where(np.einsum("ij,ij->i", normals, outward) < 0.0, -1.0, 1.0)


@dataclass(frozen=True)
class AntipodalCloud(GraspPlanner):
    """Plans antipodal grasps of an unknown object from its measured cloud. Raises PerceptionError for targets without a
    cloud.

    Metres and radians.

    ``contacts``: number of points tried as a contact; ``pairs``: number of closing axes kept. ``friction``: tangent of
    the cones in which a pair must lie, wide because normals are noisy; ``contact_friction``: the same for the contact
    patches of the pads, used for quality. ``bulge``: maximum excess width of the object between the fingers above the
    pads. ``max_slope``: of a closing axis. ``yaws``, ``beside``: number of horizontal closing axes tried through the
    middle, and offset of those on both sides of it. ``tilts``: of the approach about the closing axis, from as vertical
    as possible; ``tilt_weight``: fraction of the quality that a tilt of 45° costs. ``patch_depth``: noise of the cloud
    and compliance of the pads. ``object_clearance``, ``surroundings_clearance``, ``support_clearance``: of the open
    hand. ``apart``, ``apart_angle``: grasps closer than both count as one. ``max_candidates``: maximum number of
    returned grasps.
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
        """Return the grasps of ``target``, best first; empty for a cloud with too few points. See
        ``GraspPlanner.plan``.
        """
        if target.cloud is None:
            raise PerceptionError(
                "AntipodalCloud needs a target with a cloud; for a target with only a box, use the plug-in "
                "bounding_box_grasps.py"
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
        openings = self.hand.openings(contacts.width + 2.0 * cloud.unseen, gripper)
        tried = hands.selected(order)
        lowest = shape.lowest(tried, openings[order]) - support_height
        free = ~shape.touches(tried, openings[order], cloud.bridged, self.object_clearance + cloud.unseen)
        free &= lowest >= self.support_clearance - 1e-6
        others = surroundings_of(target, support_height, shape.reach + float(np.ptp(cloud.points, axis=0).max()))
        around = shape.clearances(tried, openings[order], others)
        free &= around > self.surroundings_clearance
        clearances = np.zeros(len(hands))
        clearances[order] = np.minimum(around, lowest)
        chosen = different_hands(hands, order[free], self.max_candidates, self.apart, self.apart_angle)
        return tuple(
            replace(
                self._candidate(hands.pose(index), contacts.width[index], quality[index], gripper),
                opening=float(openings[index]),
                clearance=float(clearances[index]),
            )
            for index in chosen
        )

    def _hands(
        self, cloud: CompletedCloud, gripper: GripperModel, shape: HandShape, support_height: float
    ) -> HandPoses:
        """Return tilted hands on all closing axes, each as deep as palm and support allow, and at the axis itself."""
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
        """Return middles and unit directions (A, 3) along which the hand might close."""
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

    def _candidate(self, tool: Pose, width: float, quality: float, gripper: GripperModel) -> GraspCandidate:
        rotation = tool.rotation
        kind = "top" if rotation[2, 2] < -math.cos(math.pi / 4) else "side"
        return self.hand.candidate(
            tool.position, rotation[:, 2], rotation[:, 1], float(width), float(quality), kind, gripper
        )
