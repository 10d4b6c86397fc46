"""Rendered views of furniture with handles, and of things without any, with known truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.perception_measures.distractors import (
    HANDLELESS,
    Parts,
    block,
    chair,
    moved,
    picture_frame,
    row_of_objects,
    some_color,
    standing_object,
    table,
    towel,
)
from benchmarks.rendering import DepthNoise, render_view
from bestman_bt.messages import Handle, Pose, RGBDImage
from bestman_bt.perception.view import View
from bestman_bt.scene.furniture_generator.generate import generate_furniture
from bestman_bt.scene.scene import FurnitureModel

KINDS = ("drawer_chest", "cupboard", "fridge", "dishwasher", "microwave")
NEAREST, FARTHEST = 0.7, 1.8
WIDEST_ANGLE = math.radians(40.0)
MIN_SEEN = 0.6
BORDER = 12.0  # pixels along the image's border in which a handle is not in view
_TRUE_DEPTH = DepthNoise(0.0, 0.0, 0.0, 0.0, 1e-6)


@dataclass(frozen=True, eq=False)
class TrueHandle:
    """``seen``: the share of it that is in the image and not hidden. ``counted``: seen enough, within the range."""

    handle: Handle
    seen: float
    counted: bool


@dataclass(frozen=True, eq=False)
class HandleView:
    """A view, the handles that are there, in its frame, and a word for what it shows. ``shiny``: depth drops out."""

    view: View
    handles: tuple[TrueHandle, ...]
    what: str
    shiny: bool = False


def handle_view(seed: int, shiny: float = 0.3) -> HandleView:
    """The scene of a seed. One in four is without handles; in one of five with them, the share ``shiny`` of depth drops
    out on the handles."""
    rng = np.random.default_rng(seed)
    if seed % 4 == 3:
        return _without_handles(rng)
    return _furniture_view(rng, KINDS[int(rng.choice(len(KINDS), p=[0.34, 0.34, 0.12, 0.1, 0.1]))], shiny)


def _furniture_view(rng: np.random.Generator, kind: str, shiny: float) -> HandleView:
    model = generate_furniture(kind, rng)
    lift = 0.0 if kind != "microwave" else float(rng.uniform(0.7, 0.95))
    furniture_from_room = Pose(np.array([0.0, 0.0, -lift]))
    handles = [articulation.handle for articulation in model.articulations]
    front = float(np.mean([h.pose.position[0] - h.standoff * h.outward[0] for h in handles]))
    parts = _shapes(model)
    parts += moved(_surroundings(rng, model, front, lift), furniture_from_room)
    target = handles[int(rng.integers(len(handles)))].pose.position
    camera = _camera(rng, target, furniture_from_room.inverse().apply(target[None])[0][2])
    # The frame is a map: the furniture stands anywhere in it, turned as it likes.
    map_from_furniture = Pose.from_xyz_rpy(
        (*rng.uniform(-3, 3, 2), lift), (0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
    )
    clean = render_view(parts, camera, rng, _TRUE_DEPTH)
    seen = [_share_seen(clean, handle) for handle in handles]
    counted = [share >= MIN_SEEN and _in_range(handle, camera) for share, handle in zip(seen, handles, strict=True)]
    drops = np.zeros(clean.image.depth.shape, dtype=bool)
    is_shiny = bool(rng.random() < 0.2)
    if is_shiny:
        drops = _on_handles(clean, handles) & (rng.random(drops.shape) < shiny)
    view = _measured(clean, drops, rng).seen_from(map_from_furniture)
    truth = tuple(
        TrueHandle(handle.seen_from(map_from_furniture), share, counts)
        for handle, share, counts in zip(handles, seen, counted, strict=True)
    )
    return HandleView(view, truth, kind, is_shiny)


def _surroundings(rng: np.random.Generator, model: FurnitureModel, front: float, lift: float) -> Parts:
    """Floor, wall and what stands about; x = ``front`` is the furniture's front, z = 0 the floor."""
    depth, width = model.footprint
    floor = block((-4.0, -4.0, -0.02), (4.0, 4.0, 0.0), some_color(rng))
    back = depth / 2 + float(rng.uniform(0.0, 0.05))
    parts = floor + block((back, -3.0, 0.0), (back + 0.1, 3.0, 2.6), some_color(rng))
    if lift:
        parts += block((front + 0.02, -0.8, 0.0), (back, 0.8, lift), some_color(rng))
        parts += row_of_objects(rng, int(rng.integers(0, 3)), (front + 0.07, front + 0.15), (-0.7, -0.4), lift)
    elif rng.random() < 0.3:
        beside = moved(HANDLELESS[int(rng.integers(3))](rng), Pose(np.array([front, width / 2 + 0.65, 0.0])))
        parts += beside
    for _ in range(int(rng.integers(0, 3))):
        near = front - float(rng.uniform(0.04, 0.3))
        pose = Pose.from_xyz_rpy((near - 0.05, rng.uniform(-width, width) / 2, 0.0), (0.0, 0.0, rng.uniform(-3, 3)))
        parts += moved(standing_object(rng), pose)
    if rng.random() < 0.15:
        pose = Pose.from_xyz_rpy((front - rng.uniform(0.25, 0.5), rng.uniform(-width, width) / 2, 0.0), (0, 0, math.pi))
        parts += moved(chair(rng), pose)
    if rng.random() < 0.1:
        # Over a handle, or where it hides one: it hangs before the handles.
        handle = model.articulations[int(rng.integers(len(model.articulations)))].handle
        stands_out = max(0.0, handle.standoff + 1.2 * handle.radius)
        high = float(handle.pose.position[2]) + lift + float(rng.uniform(-0.15, 0.02))
        hung = Pose(np.array([front, handle.pose.position[1] + rng.uniform(-0.2, 0.2), high]))
        parts += moved(towel(rng, stands_out + float(rng.uniform(0.004, 0.02))), hung)
    return parts


def _without_handles(rng: np.random.Generator) -> HandleView:
    parts = block((-4.0, -4.0, -0.02), (4.0, 4.0, 0.0), some_color(rng))
    what = ("wall", "table", "bookshelf", "cartons", "sideboard")[int(rng.integers(5))]
    target = np.array([0.0, float(rng.uniform(-0.4, 0.4)), float(rng.uniform(0.3, 1.1))])
    if what == "wall":
        parts += block((0.0, -3.0, 0.0), (0.1, 3.0, 2.6), some_color(rng))
        parts += block((-0.015, -3.0, 0.0), (0.0, 3.0, 0.08), some_color(rng))
        parts += moved(picture_frame(rng), Pose(np.array([0.0, target[1] + 0.2, target[2] + 0.2])))
        parts += moved(
            towel(rng, float(rng.uniform(0.002, 0.025))), Pose(np.array([0.0, target[1] - 0.3, target[2] + 0.2]))
        )
        parts += row_of_objects(rng, 4, (-0.12, -0.05), (-0.8, 0.8), 0.0)
    elif what == "table":
        gap = float(rng.uniform(0.0, 0.06))
        parts += block((0.0, -3.0, 0.0), (0.1, 3.0, 2.6), some_color(rng))
        height = float(rng.uniform(0.4, 0.95))
        parts += moved(table(rng, 1.0, 0.5, height), Pose(np.array([-0.25 - gap, 0.0, 0.0])))
        parts += row_of_objects(rng, 6, (-0.4, -0.05 - gap), (-0.45, 0.45), height)
        parts += moved(chair(rng), Pose.from_xyz_rpy((-0.6, rng.uniform(-0.3, 0.3), 0.0), (0, 0, rng.uniform(-3, 3))))
        target[2] = height
    else:
        parts += block((0.45, -3.0, 0.0), (0.5, 3.0, 2.6), some_color(rng))
        scene = {"bookshelf": HANDLELESS[0], "cartons": HANDLELESS[1], "sideboard": HANDLELESS[2]}[what]
        parts += scene(rng)
        parts += row_of_objects(rng, 2, (-0.15, -0.08), (-0.5, 0.5), 0.0)
    camera = _camera(rng, target, float(target[2]))
    clean = render_view(parts, camera, rng, _TRUE_DEPTH)
    map_from_room = Pose.from_xyz_rpy((*rng.uniform(-3, 3, 2), 0.0), (0.0, 0.0, float(rng.uniform(-math.pi, math.pi))))
    nothing = np.zeros(clean.image.depth.shape, dtype=bool)
    return HandleView(_measured(clean, nothing, rng).seen_from(map_from_room), (), what)


def _shapes(model: FurnitureModel) -> Parts:
    parts: Parts = [(part, color[:3]) for part, color in zip(model.parts, model.colors, strict=True)]
    for articulation in model.articulations:
        parts += [(part, color[:3]) for part, color in zip(articulation.parts, articulation.colors, strict=True)]
    return parts


def _camera(rng: np.random.Generator, target: NDArray[np.float64], height: float) -> Pose:
    """In front of the front (which faces -x), up to 40° to its side, looking 0 to 35° down, near the target."""
    azimuth, distance = float(rng.uniform(-WIDEST_ANGLE, WIDEST_ANGLE)), float(rng.uniform(NEAREST, FARTHEST))
    # Not higher than a robot's head, nor below its base.
    steepest = min(math.radians(35.0), math.asin(np.clip((1.9 - height) / distance, 0.0, 1.0)))
    down = float(rng.uniform(0.0, steepest))
    away = np.array([-math.cos(down) * math.cos(azimuth), math.cos(down) * math.sin(azimuth), math.sin(down)])
    eye = target + distance * away
    forward = target + np.array([0.0, *rng.normal(0.0, 0.08, 2)]) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.stack([right, np.cross(forward, right), forward], axis=1), eye
    return Pose.from_matrix(matrix)


def _in_range(handle: Handle, camera: Pose) -> bool:
    ray = camera.position - handle.pose.position
    sideways = math.atan2(abs(ray @ np.cross([0.0, 0.0, 1.0], handle.outward)), ray @ handle.outward)
    return NEAREST <= float(np.linalg.norm(ray)) <= FARTHEST and sideways <= WIDEST_ANGLE


def _share_seen(view: View, handle: Handle) -> float:
    """Of points along what is gripped, on the side towards the camera: in the image, with nothing before them."""
    local = handle.pose.inverse().apply(view.viewpoint[None])[0]
    along = np.linspace(-0.48, 0.48, 25) * handle.length
    if handle.kind == "edge":
        # The face of the lip, a few millimetres from its border.
        surface = np.stack([along, np.zeros(25), np.full(25, handle.radius)], axis=1)
        recess = _recess_seen(view, handle, along)
    else:
        towards = np.array([0.0, local[1], local[2]]) / math.hypot(local[1], local[2])
        across = np.cross([1.0, 0.0, 0.0], towards)
        sides = [math.sin(a) * across + math.cos(a) * towards for a in (-0.8, 0.0, 0.8)]
        along = along if handle.kind == "bar" else np.zeros(1)
        surface = np.concatenate([along[:, None] * [1.0, 0.0, 0.0] + handle.radius * side for side in sides])
        recess = np.ones(len(surface), dtype=bool)
    pixels, depth = view.project(handle.pose.apply(surface))
    measured = view.measured_depth(pixels)
    k = view.image.intrinsics
    inside = ((pixels > BORDER) & (pixels < np.array([k.width, k.height]) - 1 - BORDER)).all(axis=1)
    # The pixel nearest to a point may show what is beside a thin bar: farther away, never nearer.
    return float((recess & inside & (measured > depth - 0.003) & (measured < depth + 0.08)).mean())


def _recess_seen(view: View, handle: Handle, along: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where along a lip the opening beyond it shows something behind the front, and not just the room's wall.

    Seen from its far side, a lip at the outer border of a door looks like any door.
    """
    assert handle.panel is not None
    middle = handle.pose.inverse().apply(handle.panel.position[None])[0]
    beyond = -math.copysign(1.0, middle[1])
    shares = np.zeros(len(along))
    for distance in (0.016, 0.022, 0.028, 0.034, 0.040):
        points = np.stack([along, np.full(len(along), beyond * distance), np.full(len(along), handle.radius)], axis=1)
        pixels, depth = view.project(handle.pose.apply(points))
        behind = view.measured_depth(pixels) - depth
        shares += (behind > 0.012) & (behind < 0.45)
    return shares >= 2


def _on_handles(view: View, handles: list[Handle]) -> NDArray[np.bool_]:
    """The pixels that show a bar or a knob (an edge is a part of its front)."""
    points = view.frame_from_camera.apply(view.image.points())
    on = np.zeros(view.image.depth.shape, dtype=bool)
    for handle in handles:
        if handle.kind != "edge":
            local = np.abs(handle.pose.inverse().apply(points))
            limits = np.array([handle.length / 2, handle.radius, handle.radius * 1.5]) + 0.004
            on |= (local < limits).all(axis=-1)
    return on


def _measured(clean: View, drops: NDArray[np.bool_], rng: np.random.Generator) -> View:
    depth = DepthNoise().apply(clean.image.depth.astype(np.float64), rng)
    depth[drops] = 0.0
    image = RGBDImage(clean.image.rgb, depth, clean.image.intrinsics, clean.image.stamp)
    return View(image, clean.frame_from_camera)
