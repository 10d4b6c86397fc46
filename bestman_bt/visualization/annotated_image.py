"""A camera image with the perceived scene: masks, boxes, axes with uncertainty, handles, grasps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.visualization.marks import (
    AXES,
    GRASP_COLOR,
    HANDLE_COLOR,
    OPENING_COLOR,
    SURFACE_COLOR,
    Color,
    GraspMark,
    HandleMark,
    ObjectMark,
    SceneMarks,
    SurfaceMark,
    box_edges,
    grasp_lines,
    object_color,
)

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""

GAP = 8.0
"""Smallest distance between a label and its anchor, pixels."""
COVERING = 4.0
"""Weight of covering something that should stay visible, relative to being a few label heights further away."""
RINGS = (0.0, 1.0, 2.0, 3.5, 5.0, 8.0)
"""Further distances to try, in heights of the label."""


@dataclass(frozen=True)
class Label:
    """A label. ``anchor``: the pixel that it names; ``size``: width and height of its box, pixels."""

    anchor: tuple[float, float]
    size: tuple[float, float]


def place_labels(
    labels: Sequence[Label], keep_clear: Sequence[Rectangle], picture: tuple[float, float]
) -> list[Rectangle]:
    """Return one rectangle per label within the ``picture`` (width, height), placed in order.

    Each label takes the position around its anchor that covers the least area of earlier labels, then of
    ``keep_clear``, then the nearest one. A label larger than the picture starts at its left or upper border.
    """
    placed: list[Rectangle] = []
    for label in labels:
        places = [_moved_inside(place, picture) for place in _around(label)]
        placed.append(min(places, key=lambda place: _cost(place, label, placed, keep_clear)))
    return placed


def _around(label: Label) -> list[Rectangle]:
    (x, y), (width, height) = label.anchor, label.size
    places = []
    for ring, (right, down) in product(RINGS, product((1, 0, -1), (-1, 0, 1))):
        if right or down:
            away = GAP + ring * height
            left = x + right * away - (1 - right) / 2 * width
            top = y + down * away - (1 - down) / 2 * height
            places.append((left, top, left + width, top + height))
    return places


def _moved_inside(place: Rectangle, picture: tuple[float, float]) -> Rectangle:
    left, top, right, bottom = place
    dx = max(0.0, -left) if left < 0.0 else min(0.0, picture[0] - right)
    dy = max(0.0, -top) if top < 0.0 else min(0.0, picture[1] - bottom)
    dx, dy = max(dx, -left), max(dy, -top)
    return left + dx, top + dy, right + dx, bottom + dy


def _cost(
    place: Rectangle, label: Label, labels: Sequence[Rectangle], keep_clear: Sequence[Rectangle]
) -> tuple[float, float]:
    over_labels = sum(overlap(place, other) for other in labels)
    area = label.size[0] * label.size[1]
    covered = sum(overlap(place, other) for other in keep_clear) / area
    x, y = label.anchor
    away = math.hypot(max(place[0] - x, x - place[2], 0.0), max(place[1] - y, y - place[3], 0.0))
    return over_labels, COVERING * covered + away / (6.0 * label.size[1])


def overlap(one: Rectangle, other: Rectangle) -> float:
    """Return the area in which two rectangles overlap, square pixels."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    return max(0.0, width) * max(0.0, height)


FONT = cv2.FONT_HERSHEY_SIMPLEX
FONT_SIZE = 0.5
PADDING = 4
"""Pixels between a label's text and its border."""
PAPER: Color = (30, 30, 30)
INK: Color = (255, 255, 255)


class Canvas:
    """``scale`` times as large as the image; ``pixels``: (H, W, 3) uint8 rgb, complete after ``finish``."""

    def __init__(self, image: RGBDImage, frame_from_camera: Pose, scale: int) -> None:
        size = (image.intrinsics.width * scale, image.intrinsics.height * scale)
        self.pixels: NDArray[np.uint8] = np.ascontiguousarray(
            cv2.resize(image.rgb, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8
        )
        self._scale = scale
        self._image = image
        self._camera_from_frame = frame_from_camera.inverse()
        self._labels: list[tuple[Label, str, Color]] = []
        self._kept_clear: list[Rectangle] = []

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pixels (N, 2) of points (N, 3); NaN behind the camera."""
        k = self._image.intrinsics
        x, y, z = self._camera_from_frame.apply(np.atleast_2d(points)).T
        z = np.where(z > 0.02, z, np.nan)
        # The middle of the image's pixel (0, 0) lies at (0, 0); that of the canvas lies half a pixel of its own inside.
        return (np.column_stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z]) + 0.5) * self._scale - 0.5

    def inside(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether each of the pixels (N, 2) lies on the canvas, (N,) bool."""
        limit = np.array(self.pixels.shape[1::-1])
        return np.asarray(((pixels >= 0) & (pixels < limit)).all(axis=1))  # NaN is not

    def seen(self, points: NDArray[np.float64], margin: float) -> NDArray[np.bool_]:
        """Return which points (N, 3) the image shows: those without measured depth more than ``margin`` metres before
        them.
        """
        pixels = self.project(points)
        seen = self.inside(pixels)
        columns, rows = (pixels[seen] / self._scale).astype(int).T
        measured = self._image.depth[rows, columns]
        depth = self._camera_from_frame.apply(points[seen])[:, 2]
        seen[seen] = (measured <= 0.0) | (measured > depth - margin)
        return seen

    def lines(self, segments: NDArray[np.float64], color: Color, thickness: int = 2) -> None:
        """Draw line segments (N, 2, 3), metres."""
        ends = self.project(segments.reshape(-1, 3)).reshape(-1, 2, 2)
        for first, second in ends[np.isfinite(ends).all(axis=(1, 2))]:
            cv2.line(self.pixels, _pixel(first), _pixel(second), color, thickness, cv2.LINE_AA)

    def mask(self, points: NDArray[np.float64], color: Color, opacity: float = 0.45) -> None:
        """Tint the pixels of measured points (N, 3) metres, and draw a line around them."""
        covered = np.zeros(self.pixels.shape[:2], dtype=np.uint8)
        for place in self.project(points):
            cv2.circle(covered, _pixel(place), 2 * self._scale, 1, -1)
        covered = np.asarray(cv2.morphologyEx(covered, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)), np.uint8)
        chosen = covered > 0
        tinted = (1 - opacity) * self.pixels[chosen] + opacity * np.array(color)
        self.pixels[chosen] = tinted.astype(np.uint8)
        outlines, _ = cv2.findContours(covered, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(self.pixels, outlines, -1, color, 1, cv2.LINE_AA)

    def keep_clear(self, points: NDArray[np.float64]) -> None:
        """Keep labels off the rectangle around points (N, 3), metres."""
        pixels = self.project(points)
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if len(pixels):
            (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
            self._kept_clear.append((float(left), float(top), float(right), float(bottom)))

    def label(self, point: NDArray[np.float64], text: str, color: Color) -> None:
        """Add a text near a point (3,), metres; none if the point is outside the picture."""
        place = self.project(point)
        if self.inside(place)[0]:
            (width, height), base = cv2.getTextSize(text, FONT, FONT_SIZE, 1)
            size = (width + 2 * PADDING, height + base + 2 * PADDING)
            self._labels.append((Label((float(place[0, 0]), float(place[0, 1])), size), text, color))

    def finish(self) -> NDArray[np.uint8]:
        """Draw the labels, after everything that they should not cover is known. Returns ``pixels``."""
        picture = (float(self.pixels.shape[1]), float(self.pixels.shape[0]))
        places = place_labels([label for label, _, _ in self._labels], self._kept_clear, picture)
        labelled = list(zip(self._labels, places, strict=True))
        for (label, _, color), (left, top, right, bottom) in labelled:
            x, y = label.anchor
            nearest = np.array([min(max(x, left), right), min(max(y, top), bottom)])
            cv2.line(self.pixels, _pixel(np.array([x, y])), _pixel(nearest), color, 1, cv2.LINE_AA)
        for (_, text, color), (left, top, right, bottom) in labelled:
            corners = _pixel(np.array([left, top])), _pixel(np.array([right, bottom]))
            cv2.rectangle(self.pixels, *corners, PAPER, -1)
            cv2.rectangle(self.pixels, *corners, color, 1)
            (_, height), _ = cv2.getTextSize(text, FONT, FONT_SIZE, 1)
            foot = _pixel(np.array([left + PADDING, top + PADDING + height]))
            cv2.putText(self.pixels, text, foot, FONT, FONT_SIZE, INK, 1, cv2.LINE_AA)
        return self.pixels


def _pixel(place: NDArray[np.float64]) -> tuple[int, int]:
    near = np.clip(place, -1e4, 1e4)
    return round(float(near[0])), round(float(near[1]))


DEVIATIONS = 3.0
"""Standard deviations that the circle around an object's place shows."""
BEHIND = 0.03
"""Metres that a mark may lie behind the measured surface and still be drawn: the far side of an object."""
SHOWN = 0.15
"""Fraction of an object that must be visible for its marks to be drawn."""
OUTLINE_STEPS = 20
"""Samples along each side of a surface."""


def annotated_image(image: RGBDImage, frame_from_camera: Pose, marks: SceneMarks, scale: int = 2) -> NDArray[np.uint8]:
    """Return the image, scaled by ``scale``, with all ``marks`` of the frame drawn; (H, W, 3) uint8 RGB.

    Occluded marks are omitted.
    """
    canvas = Canvas(image, frame_from_camera, scale)
    for surface in marks.surfaces:
        _draw_surface(canvas, surface)
    shown = {found.name: _object_in_sight(canvas, found) for found in marks.objects}
    shown |= {mark.name: canvas.seen(_along(mark), BEHIND).mean() > SHOWN for mark in marks.handles}
    for index, found in enumerate(marks.objects):
        if shown[found.name]:
            _draw_object(canvas, found, object_color(index))
    for grasp in marks.grasps:
        if shown.get(grasp.target, True):
            _draw_grasp(canvas, grasp)
    for mark in marks.handles:
        if shown[mark.name]:
            _draw_handle(canvas, mark)
    return canvas.finish()


def _draw_surface(canvas: Canvas, surface: SurfaceMark) -> None:
    """Draw the visible part of the outline, and its name at the lowest visible point, preferably on the right."""
    x, y = surface.size[0] / 2, surface.size[1] / 2
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    steps = np.arange(OUTLINE_STEPS)[:, None] / OUTLINE_STEPS
    sides = [first + steps * (second - first) for first, second in zip(corners, np.roll(corners, -1, 0), strict=True)]
    outline = surface.pose.apply(np.concatenate(sides))
    seen = canvas.seen(outline, BEHIND)
    segments = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    canvas.lines(segments[seen & np.roll(seen, -1)], SURFACE_COLOR, 1)
    if seen.any():
        pixels = canvas.project(outline[seen])
        corner = outline[seen][np.argmax(pixels @ [0.2, 1.0])]
        canvas.label(corner, f"{surface.name}, {surface.pose.position[2]:.3f} m high", SURFACE_COLOR)


def _object_in_sight(canvas: Canvas, found: ObjectMark) -> bool:
    points = found.points if len(found.points) else found.pose.position[None]
    return bool(canvas.seen(points, BEHIND).mean() > SHOWN)


def _draw_object(canvas: Canvas, found: ObjectMark, color: Color) -> None:
    canvas.mask(found.points[canvas.seen(found.points, BEHIND)], color)
    lower, upper = found.model.bounds()
    edges = box_edges(found.pose, lower, upper)
    canvas.lines(edges, color, 1)
    canvas.keep_clear(edges.reshape(-1, 3))
    origin, up = found.pose.position, found.pose.rotation[:, 2]
    text = f"{found.name}, unknown"
    if found.recognised:
        length = 0.6 * float(found.model.size.max())
        for index, (axis, axis_color) in enumerate(zip(found.pose.rotation.T, AXES, strict=True)):
            # A body of revolution has no x and no y.
            if found.model.symmetry_order or index == 2:
                canvas.lines(np.array([[origin, origin + length * axis]]), axis_color, 2)
        foot = origin + float(lower[2]) * up
        _draw_circle(canvas, foot, DEVIATIONS * found.position_std, color)
        _draw_yaws(canvas, found, foot, color)
        text = f"{found.name} {found.confidence:.2f}, ±{1e3 * found.position_std:.1f} mm"
        if found.yaw_set.arcs:
            text += f", yaw ±{math.degrees(found.yaw_set.width) / 2:.0f}°"
    canvas.label(origin + float(upper[2]) * up, text, color)


def _draw_circle(canvas: Canvas, centre: NDArray[np.float64], radius: float, color: Color) -> None:
    turns = np.linspace(0.0, 2 * math.pi, 33)
    ring = centre + radius * np.column_stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)])
    canvas.lines(np.stack([ring[:-1], ring[1:]], axis=1), color, 1)


def _draw_yaws(canvas: Canvas, found: ObjectMark, foot: NDArray[np.float64], color: Color) -> None:
    """Draw the arcs of possible directions of the object's x axis, around its foot."""
    radius = 0.75 * float(np.linalg.norm(found.model.size[:2]))
    for middle, half in found.yaw_set.arcs:
        turns = middle + np.linspace(-half, half, max(2, math.ceil(half * 20)))
        arc = foot + radius * np.column_stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)])
        canvas.lines(np.stack([arc[:-1], arc[1:]], axis=1), color, 3)
        canvas.lines(np.array([[foot, arc[0]], [foot, arc[-1]]]), color, 1)


def _draw_grasp(canvas: Canvas, grasp: GraspMark) -> None:
    lines = grasp_lines(grasp)
    canvas.lines(lines, (20, 20, 20), 4)
    canvas.lines(lines, GRASP_COLOR, 2)
    canvas.keep_clear(lines.reshape(-1, 3))


def _along(mark: HandleMark) -> NDArray[np.float64]:
    """Return points (N, 3), metres, on the handle's front."""
    handle = mark.handle
    offsets = np.linspace(-0.5, 0.5, OUTLINE_STEPS)[:, None] * handle.length * handle.axis
    points: NDArray[np.float64] = handle.pose.position + handle.radius * handle.outward + offsets
    return points


def _draw_handle(canvas: Canvas, mark: HandleMark) -> None:
    handle = mark.handle
    middle, half = handle.pose.position, handle.length / 2 * handle.axis
    canvas.lines(np.array([[middle - half, middle + half]]), HANDLE_COLOR, 3)
    canvas.keep_clear(np.array([middle - half, middle + half]))
    canvas.lines(np.array([[middle, middle + 0.12 * handle.opening_direction]]), OPENING_COLOR, 2)
    if handle.hinge is not None and handle.hinge_direction is not None and handle.panel_size is not None:
        # Doors turn about an upright edge of their panel, flaps about a level one.
        upright = abs(float(handle.hinge_direction[2])) > 0.7
        reach = handle.panel_size[1 if upright else 0] / 2 * handle.hinge_direction
        canvas.lines(np.array([[handle.hinge - reach, handle.hinge + reach]]), OPENING_COLOR, 1)
    joint = {"revolute": "door", "prismatic": "drawer"}.get(handle.joint or "", "unknown joint")
    text = f"{mark.name}: {handle.kind}, {joint} {handle.joint_confidence:.2f}, radius {1e3 * handle.radius:.0f} mm"
    canvas.label(middle, text, HANDLE_COLOR)
