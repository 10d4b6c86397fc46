"""Grasps of a known model: computed from its shape if it is a box, cylinder or ball, else antipodal grasps on its
surface. The latter come with the model (``ObjectModel.grasps``) or are computed on first use. They are also used for a
box, cylinder or ball if surrounding obstacles block all of its straight grasps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Box, Cylinder, Mesh, ObjectGrasp, ObjectModel, PlacedShape, Pose, Shape, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.contact_quality import ContactQuality, close_pads
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands, hands_about
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import clear_candidates, surroundings_of
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.robot_model.model import GripperModel

if TYPE_CHECKING:
    import trimesh

# Antipodal grasps on a model's surface, found once per object.
# Two contacts are antipodal where the line between them lies in both friction cones (Nguyen, "Constructing Force-
# Closure Grasps", 1988). Contacts are sampled, rays through the solid give their opposites, and each pair is tried with
# hands turned about the closing axis. The pads are then closed on the samples: thin walls (rims, handles) need no case
# of their own.


@dataclass(frozen=True)
class AntipodalModel:
    """Plans grasps on the model of an object.

    Metres, radians.

    ``samples``: approximate number of surface samples; ``contacts``: number of them tried as a first contact;
    ``pairs``: number of their pairs that are evaluated. ``friction``: of the cones, tangent of the half angle.
    ``turn``: angle between hands about one closing axis. ``bulge``: maximum excess width of the object between the
    fingers above the pads. ``patch_depth``: compliance of the pads. ``surface_clearance``: between open hand and
    object; the palm clearance is that of ``hand``. ``apart``, ``apart_angle``: grasps closer than both count as one.
    """

    samples: int = 2200
    contacts: int = 350
    pairs: int = 300
    friction: float = 0.5
    bulge: float = 0.004
    turn: float = math.radians(30.0)
    patch_depth: float = 0.0012
    surface_clearance: float = 0.002
    apart: float = 0.012
    apart_angle: float = math.radians(25.0)
    quality: ContactQuality = field(default_factory=ContactQuality)
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def grasps(
        self, model: ObjectModel, gripper: GripperModel, rng: np.random.Generator, count: int = 64
    ) -> tuple[ObjectGrasp, ...]:
        """Return up to ``count`` different grasps of ``model``, best first, from all sides, for any resting pose.

        Empty if the gripper cannot grasp it. Raises PerceptionError for a model without collision shapes.
        """
        rough = solid_surface(model, 0.010)
        spacing = 0.010 * math.sqrt(max(len(rough.points), 1) / self.samples)
        surface = solid_surface(model, spacing)
        starts, closing, widths = self._pairs(surface, gripper, rng)
        angles = np.arange(0.0, 2 * math.pi - 1e-9, self.turn)
        hands = hands_about(starts + closing * widths[:, None] / 2, closing, angles)
        contacts = close_pads(
            surface.points,
            surface.normals,
            hands,
            self.hand.openings(np.repeat(widths, len(angles)), gripper),
            gripper.part.pad_size,
            gripper.part.finger_depth,
            self.patch_depth,
        )
        widest = self.hand.widest(gripper)
        quality = self.quality.judge(
            hands, contacts, surface.centre_of_mass, gripper, widest=widest, friction=self.friction, bulge=self.bulge
        )
        # The pads decide where the middle is: the hand closes there, and both fingers have the same room.
        hands = hands.shifted(contacts.centre[:, 1], 1)
        tried = np.argsort(-quality, kind="stable")
        tried = tried[quality[tried] > 0.0]
        # The palm begins where the hand may reach no further over an object, a little before its true place.
        reach = self.hand.reach(gripper) + self.surface_clearance
        shape = HandShape(gripper, self.shape, reach)
        openings = self.hand.openings(contacts.width[tried], gripper)
        clear = shape.clearances(hands.selected(tried), openings, surface.points, 1.0)
        chosen = different_hands(hands, tried[clear > self.surface_clearance], count, self.apart, self.apart_angle)
        return tuple(
            ObjectGrasp(hands.pose(index), float(contacts.width[index]), float(quality[index])) for index in chosen
        )

    def _pairs(
        self, surface: SolidSurface, gripper: GripperModel, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], ...]:
        """Return first contacts (P, 3), unit closing directions (P, 3) and distances (P,) of antipodal pairs."""
        chosen = rng.permutation(len(surface.points))[: self.contacts]
        points, inward = surface.points[chosen], -surface.normals[chosen]
        found = [(points, inward, inward, *surface.opposite(points, inward, last)) for last in (False, True)]
        for last in (False, True):
            _, _, _, ends, leaving = found[int(last)]
            # Where the faces are not parallel, the line half way between their normals lies deepest in both cones.
            between = inward + leaving
            length = np.linalg.norm(between, axis=1)
            usable = np.isfinite(ends).all(axis=1) & (length > 1.0)
            line = between[usable] / length[usable, None]
            found.append((points[usable], inward[usable], line, *surface.opposite(points[usable], line, last)))
        starts, starting, lines, ends, leaving = (np.concatenate(parts) for parts in zip(*found, strict=True))
        widths = np.linalg.norm(ends - starts, axis=1)
        cone = math.cos(math.atan(self.friction))
        with np.errstate(invalid="ignore"):
            antipodal = (np.einsum("ij,ij->i", lines, starting) >= cone) & (
                np.einsum("ij,ij->i", lines, leaving) >= cone
            )
            antipodal &= (widths > gripper.part.min_width) & (widths <= self.hand.widest(gripper))
        # First and last exit are often the same.
        _, once = np.unique(np.round(np.column_stack([starts, lines, widths]), 6), axis=0, return_index=True)
        kept = np.sort(once[antipodal[once]])
        kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), self.pairs)).astype(np.intp)]
        return starts[kept], lines[kept], widths[kept]


UP = np.array([0.0, 0.0, 1.0])


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


@dataclass(frozen=True)
class ModelBased(GraspPlanner):
    """Plans grasps of a known object from its shape or precomputed grasps. Raises PerceptionError without a model.

    Metres and radians.

    ``yaw_step``: between grasps around an axis of revolution. ``sides``: also propose grasps from the side.
    ``room_below``: height of a hand that grasps from the side above the support, if the object is that tall, because
    the wrist reaches lower than the fingers when the object is put down. ``spacing``: of the samples that the hand must
    not touch. ``max_candidates``: maximum number of returned grasps. ``surroundings_clearance``: minimum between open
    hand and ``GraspTarget.surroundings``. ``antipodal_count``: grasps to find on a model without precomputed ones.
    ``max_tilt``: of their approach from straight down; ``tilt_weight``: fraction of the quality lost at 90°.
    """

    yaw_step: Annotated[float, "rad"] = math.radians(30.0)
    sides: bool = True
    room_below: Annotated[float, "m"] = 0.07
    spacing: Annotated[float, "m"] = 0.006
    max_candidates: int = 120
    surroundings_clearance: Annotated[float, "m"] = 0.004
    antipodal_count: int = 128
    max_tilt: Annotated[float, "rad"] = math.radians(95.0)
    tilt_weight: float = 0.3
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)
    _found: dict[tuple[ObjectModel, GripperModel], tuple[ObjectGrasp, ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @override
    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        if target.model is None or target.frame_from_object is None:
            raise PerceptionError("ModelBased needs a target with a model; for an unknown object use AntipodalCloud")
        model, pose = target.model, target.frame_from_object
        hand, least = HandShape(gripper, self.shape), self.surroundings_clearance
        others = surroundings_of(target, support_height, hand.reach + float(np.linalg.norm(model.size)) / 2)
        candidates: list[GraspCandidate] = []
        if len(model.collision) == 1 and not isinstance(model.collision[0].shape, Mesh):
            candidates = self._from_shape(model, pose, gripper, support_height)
            candidates = clear_candidates(candidates, hand, others, support_height, least)
            if not candidates and not len(others):
                return ()
        if not candidates:
            candidates = self._placed(self._grasps(model, gripper), pose, gripper, support_height)
            candidates = clear_candidates(candidates, hand, others, support_height, least)
        candidates.sort(key=lambda candidate: -candidate.quality)
        return tuple(candidates[: self.max_candidates])

    def _grasps(self, model: ObjectModel, gripper: GripperModel) -> tuple[ObjectGrasp, ...]:
        if model.grasps:
            return model.grasps
        if (model, gripper) not in self._found:
            # The same contacts each time: a model has one set of grasps.
            rng = np.random.default_rng(0)
            self._found[model, gripper] = AntipodalModel().grasps(model, gripper, rng, self.antipodal_count)
        return self._found[model, gripper]

    def _placed(
        self, grasps: tuple[ObjectGrasp, ...], frame_from_object: Pose, gripper: GripperModel, support_height: float
    ) -> list[GraspCandidate]:
        """Return the grasps of a model that come from above or from the side, clear of the support."""
        hand, shape = self.hand, HandShape(gripper, self.shape)
        candidates = []
        for grasp in grasps:
            if not hand.fits(grasp.width, gripper):
                continue
            tool = frame_from_object @ grasp.object_from_tool
            rotation = tool.rotation
            tilt = math.acos(float(np.clip(-rotation[2, 2], -1.0, 1.0)))
            openings = hand.openings(np.array([grasp.width]), gripper)
            lowest = float(shape.lowest(HandPoses(rotation[None], tool.position[None]), openings)[0])
            if tilt > self.max_tilt or lowest < support_height + hand.support_clearance:
                continue
            quality = grasp.quality * (1.0 - self.tilt_weight * tilt / (math.pi / 2))
            kind = "top" if tilt < math.pi / 4 else "side"
            position, approach, closing = tool.position, rotation[:, 2], rotation[:, 1]
            candidates.append(hand.candidate(position, approach, closing, grasp.width, quality, kind, gripper))
        return candidates

    def _from_shape(
        self, model: ObjectModel, frame_from_object: Pose, gripper: GripperModel, support_height: float
    ) -> list[GraspCandidate]:
        """Return grasps of a box, a cylinder or a ball, in closed form."""
        outline = self._outline(model, frame_from_object)
        return [
            candidate
            for contacts in self._contacts(model.collision[0], frame_from_object)
            if self.hand.fits(contacts.width, gripper)
            for candidate in self._hands(contacts, outline, gripper, support_height)
        ]

    def _outline(self, model: ObjectModel, frame_from_object: Pose) -> NDArray[np.float64]:
        """Return samples (n, 3) of the collision shapes' surface in the frame, which the hand must not touch."""
        return np.concatenate(
            [
                (frame_from_object @ placed.pose).apply(sample_shape(placed.shape, self.spacing)[0])
                for placed in model.collision
            ]
        )

    def _contacts(self, placed: PlacedShape, frame_from_object: Pose) -> Iterator[_Contacts]:
        pose = frame_from_object @ placed.pose
        axes, centre = pose.rotation.T, pose.position
        turns = np.arange(0.0, math.pi - 1e-9, self.yaw_step)
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

    def _hands(
        self, contacts: _Contacts, outline: NDArray[np.float64], gripper: GripperModel, support_height: float
    ) -> Iterator[GraspCandidate]:
        if abs(contacts.closing[2]) > 0.26:
            return
        level = contacts.closing - contacts.closing[2] * UP
        level /= np.linalg.norm(level)
        for sign in (1.0, -1.0):
            yield from self._from_top(contacts, sign * level, outline, gripper, support_height)
            if self.sides:
                yield from self._from_side(contacts, sign * level, outline, gripper, support_height)

    def _from_top(
        self,
        contacts: _Contacts,
        closing: NDArray[np.float64],
        outline: NDArray[np.float64],
        gripper: GripperModel,
        support_height: float,
    ) -> Iterator[GraspCandidate]:
        hand = self.hand
        across = np.cross(closing, UP)
        beside = np.abs((outline - contacts.centre) @ across) < hand.hand_half_thickness
        top = float(outline[beside, 2].max()) if beside.any() else float(outline[:, 2].max())
        deepest = hand.top_height(top, support_height, gripper)
        if deepest is None:
            return
        height = max(deepest, float(contacts.centre[2]) - contacts.slack)
        if height > min(float(contacts.centre[2]) + contacts.slack, top - 0.2 * gripper.part.pad_size[1]):
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
        hand = self.hand
        approach = np.cross(closing, UP)
        lowest = support_height + hand.hand_half_thickness + hand.support_clearance
        top = float(outline[:, 2].max())
        highest = min(float(contacts.centre[2]) + contacts.slack, top - gripper.part.pad_size[0] / 2)
        height = max(float(contacts.centre[2]), lowest, min(support_height + self.room_below, highest))
        if height > highest:
            return
        # The near end of the object must stay before the palm.
        near = float(((contacts.centre - outline) @ approach).max())
        behind = max(0.0, near - (gripper.part.finger_depth - hand.palm_clearance))
        if behind > 0.3 * near:
            return
        position = np.array([contacts.centre[0], contacts.centre[1], height]) - behind * approach
        rise = (height - float(contacts.centre[2])) / max(top - support_height, 1e-6)
        margin = 1.0 - contacts.width / gripper.max_width
        quality = 0.8 * contacts.quality * (0.7 + 0.15 * margin) - 0.3 * rise - 5.0 * behind
        # A camera on the hand is below it one way round and above it the other.
        for way in (closing, -closing):
            yield hand.candidate(position, approach, way, contacts.width, quality, "side", gripper)


# Gaps between parts that touch, metres: closer than this they are one solid.
_GAP = 5e-4


@dataclass(frozen=True, eq=False)
class SolidSurface:
    """A sampled surface. ``points``, ``normals``: (N, 3) samples of the union's surface in the object frame, metres,
    outward.

    ``triangles``: (F, 3, 3) corners of all parts. ``centre_of_mass``: (3,), for uniform density.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.float64]
    centre_of_mass: NDArray[np.float64]

    def opposite(
        self, points: NDArray[np.float64], directions: NDArray[np.float64], last: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the points and outward normals (R, 3) where rays from surface points (R, 3) along unit inward
        ``directions`` leave the solid.

        This is the first exit, or with ``last`` the last one: beyond the hollow of a cup. NaN if a ray does not start
        inside.
        """
        ends, normals = np.full(points.shape, np.nan), np.full(points.shape, np.nan)
        for i, (point, direction) in enumerate(zip(points, directions, strict=True)):
            distances, outward = _crossings(self.triangles, point - _GAP * direction, direction)
            # A ray enters a part where it meets the triangle's front; it has left the union when it has left all.
            steps = np.where(outward @ direction > 0.0, -1, 1)
            order = np.argsort(distances - _GAP * (steps > 0), kind="stable")
            inside = np.cumsum(steps[order])
            left = np.flatnonzero((inside == 0) & (distances[order] > 2 * _GAP))
            if len(left) and inside.min() >= 0:
                leaving = order[left[-1 if last else 0]]
                ends[i] = point + (distances[leaving] - _GAP) * direction
                normals[i] = outward[leaving]
        return ends, normals


def solid_surface(model: ObjectModel, spacing: float) -> SolidSurface:
    """Sample the collision shapes of ``model`` about every ``spacing`` metres, without samples inside another shape."""
    if not model.collision:
        raise PerceptionError(f"model {model.name!r} has no collision shapes: there is nothing to grasp")
    meshes = [_triangulated(placed.shape) for placed in model.collision]
    for mesh, placed in zip(meshes, model.collision, strict=True):
        mesh.apply_transform(placed.pose.matrix)
    points, normals = [], []
    for i, placed in enumerate(model.collision):
        local_points, local_normals = sample_shape(placed.shape, spacing)
        part_points, part_normals = placed.pose.apply(local_points), local_normals @ placed.pose.rotation.T
        outside = np.ones(len(part_points), dtype=bool)
        for j, other in enumerate(meshes):
            if i != j:
                outside &= ~_contains(np.asarray(other.triangles), part_points + _GAP * part_normals)
        points.append(part_points[outside])
        normals.append(part_normals[outside])
    volumes = np.array([max(abs(float(mesh.volume)), 1e-12) for mesh in meshes])
    centres = np.array([mesh.center_mass if mesh.is_watertight else mesh.centroid for mesh in meshes])
    triangles = np.concatenate([np.asarray(mesh.triangles) for mesh in meshes])
    centre = np.average(centres, axis=0, weights=volumes)
    return SolidSurface(np.concatenate(points), np.concatenate(normals), triangles, centre)


def _triangulated(shape: Shape) -> trimesh.Trimesh:
    import trimesh  # takes a third of a second; runs without a grasp do not need it

    match shape:
        case Box():
            mesh: trimesh.Trimesh = trimesh.creation.box(shape.size)
        case Cylinder():
            mesh = trimesh.creation.cylinder(shape.radius, shape.length, sections=48)
        case Sphere():
            mesh = trimesh.creation.icosphere(subdivisions=3, radius=shape.radius)
        case Mesh():
            mesh = trimesh.Trimesh(shape.vertices.copy(), shape.faces.copy(), process=True)
    return mesh


def _contains(triangles: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether points (N, 3) lie inside the closed surface of ``triangles``: rays that leave it an odd number of
    times.

    The direction is oblique, so that it runs along no face of an ordinary shape.
    """
    lower, upper = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    inside: NDArray[np.bool_] = np.all((points > lower) & (points < upper), axis=1)
    direction = np.array([0.5377, 0.3188, 0.7806])
    direction /= math.sqrt(float(direction @ direction))
    for i in np.flatnonzero(inside):
        inside[i] = len(_crossings(triangles, points[i], direction)[0]) % 2 == 1
    return inside


def _crossings(
    triangles: NDArray[np.float64], origin: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return distances (M,) at which a ray meets triangles, and their unit normals (M, 3).

    Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
    """
    corner = triangles[:, 0]
    first, second = triangles[:, 1] - corner, triangles[:, 2] - corner
    across = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, across)
    safe = np.where(np.abs(determinant) > 1e-14, determinant, np.nan)
    offset = origin - corner
    u = np.einsum("ij,ij->i", offset, across) / safe
    turned = np.cross(offset, first)
    v = turned @ direction / safe
    distance = np.einsum("ij,ij->i", second, turned) / safe
    hit = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v < 1.0) & (distance > 0.0))
    normals = np.cross(first[hit], second[hit])
    return distance[hit], normals / np.linalg.norm(normals, axis=1)[:, None]
