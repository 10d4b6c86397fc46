"""A camera's picture with what was found in it: masks, boxes, axes with their uncertainty, handles, grasps."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.visualization.marks import (
    GraspMark,
    HandleMark,
    ObjectMark,
    SceneMarks,
    SurfaceMark,
    box_edges,
    grasp_lines,
    object_color,
)

Color = tuple[int, int, int]

AXES: tuple[Color, Color, Color] = ((230, 70, 70), (80, 200, 90), (80, 130, 255))
SURFACE_COLOR: Color = (120, 220, 220)
GRASP_COLOR: Color = (255, 255, 255)
HANDLE_COLOR: Color = (255, 60, 200)
DEVIATIONS = 3.0
"""Standard deviations that the circle around an object's place shows."""


def annotated_image(image: RGBDImage, frame_from_camera: Pose, marks: SceneMarks, scale: int = 2) -> NDArray[np.uint8]:
    """The picture, ``scale`` times as large, with all ``marks`` of the frame drawn into it; (H, W, 3) uint8 rgb."""
    canvas = _Canvas(image, frame_from_camera, scale)
    for surface in marks.surfaces:
        _draw_surface(canvas, surface)
    for index, found in enumerate(marks.objects):
        _draw_object(canvas, found, object_color(index))
    for grasp in marks.grasps:
        _draw_grasp(canvas, grasp)
    for handle in marks.handles:
        _draw_handle(canvas, handle)
    return canvas.pixels


class _Canvas:
    """Draws in pixels what is given in metres of the frame."""

    def __init__(self, image: RGBDImage, frame_from_camera: Pose, scale: int) -> None:
        size = (image.intrinsics.width * scale, image.intrinsics.height * scale)
        self.pixels: NDArray[np.uint8] = np.ascontiguousarray(
            cv2.resize(image.rgb, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8
        )
        self.scale = scale
        self._image = image
        self._camera_from_frame = frame_from_camera.inverse()
        self._labels: list[tuple[int, int, int, int]] = []

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (N, 2) of the canvas; NaN behind the camera."""
        k = self._image.intrinsics
        x, y, z = self._camera_from_frame.apply(np.atleast_2d(points)).T
        z = np.where(z > 0.02, z, np.nan)
        return np.column_stack([k.cx + k.fx * x / z, k.cy + k.fy * y / z]) * self.scale

    def lines(self, segments: NDArray[np.float64], color: Color, thickness: int = 2) -> None:
        """Segments (N, 2, 3) metres."""
        ends = self.project(segments.reshape(-1, 3)).reshape(-1, 2, 2)
        for first, second in ends[np.isfinite(ends).all(axis=(1, 2))]:
            cv2.line(self.pixels, _pixel(first), _pixel(second), color, thickness, cv2.LINE_AA)

    def mask(self, points: NDArray[np.float64], color: Color, opacity: float = 0.45) -> None:
        """Tint the pixels of measured points (N, 3) metres."""
        pixels = self.project(points)
        shown = np.rint(pixels[np.isfinite(pixels).all(axis=1)]).astype(int)
        covered = np.zeros(self.pixels.shape[:2], dtype=np.uint8)
        for u, v in shown:
            cv2.circle(covered, (int(u), int(v)), 2 * self.scale, 1, -1)
        chosen = cv2.morphologyEx(covered, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8)) > 0
        tinted = (1 - opacity) * self.pixels[chosen] + opacity * np.array(color)
        self.pixels[chosen] = tinted.astype(np.uint8)

    def label(self, point: NDArray[np.float64], text: str, color: Color) -> None:
        """A text near a point (3,) metres; texts do not cover each other."""
        place = self.project(point)[0]
        if not np.isfinite(place).all():
            return
        (width, height), base = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
        limit = np.array(self.pixels.shape[1::-1]) - (width + 8, base + 6)
        first = np.array([4, height + 6])
        x, y = np.clip(np.rint(place + np.array([8, -8])), first, np.maximum(limit, first)).astype(int)
        while any(
            abs(y - other) < height + 8 and x < right and left < x + width for left, right, other, _ in self._labels
        ):
            y += height + 9
        self._labels.append((int(x), int(x) + width, int(y), height))
        corner = (int(x) - 3, int(y) - height - 4), (int(x) + width + 3, int(y) + base)
        cv2.rectangle(self.pixels, *corner, (30, 30, 30), -1)
        cv2.rectangle(self.pixels, *corner, color, 1)
        cv2.putText(self.pixels, text, (int(x), int(y)), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)


def _pixel(place: NDArray[np.float64]) -> tuple[int, int]:
    near = np.clip(place, -1e4, 1e4)
    return round(float(near[0])), round(float(near[1]))


def _draw_surface(canvas: _Canvas, surface: SurfaceMark) -> None:
    x, y = surface.size[0] / 2, surface.size[1] / 2
    corners = surface.pose.apply(np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]]))
    canvas.lines(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), SURFACE_COLOR, 1)
    nearest = (
        corners[np.nanargmax(canvas.project(corners)[:, 1])] if np.isfinite(canvas.project(corners)).any() else None
    )
    if nearest is not None:
        canvas.label(nearest, f"{surface.name} {surface.pose.position[2]:.3f} m high", SURFACE_COLOR)


def _draw_object(canvas: _Canvas, found: ObjectMark, color: Color) -> None:
    canvas.mask(found.points, color)
    lower, upper = found.model.bounds()
    canvas.lines(box_edges(found.pose, lower, upper), color, 1)
    text = found.name
    if found.recognised:
        length = 0.6 * float(found.model.size.max())
        origin = found.pose.position
        for axis, axis_color in zip(found.pose.rotation.T, AXES, strict=True):
            canvas.lines(np.array([[origin, origin + length * axis]]), axis_color, 2)
        foot = origin + float(lower[2]) * found.pose.rotation[:, 2]
        _draw_circle(canvas, foot, DEVIATIONS * found.position_std, color)
        _draw_yaws(canvas, found, foot, color)
        text = f"{found.name} {found.confidence:.2f}, {1e3 * found.position_std:.1f} mm"
        if found.yaw_set.arcs:
            text += f", yaw {math.degrees(found.yaw_set.width) / 2:.0f} deg"
    top = found.pose.position + float(upper[2]) * found.pose.rotation[:, 2]
    canvas.label(top, text, color)


def _draw_circle(canvas: _Canvas, centre: NDArray[np.float64], radius: float, color: Color) -> None:
    turns = np.linspace(0.0, 2 * math.pi, 33)
    ring = centre + radius * np.column_stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)])
    canvas.lines(np.stack([ring[:-1], ring[1:]], axis=1), color, 1)


def _draw_yaws(canvas: _Canvas, found: ObjectMark, foot: NDArray[np.float64], color: Color) -> None:
    """The arcs of possible directions of the object's x axis, around its foot."""
    radius = 0.75 * float(np.linalg.norm(found.model.size[:2]))
    for middle, half in found.yaw_set.arcs:
        turns = middle + np.linspace(-half, half, max(2, math.ceil(half * 20)))
        arc = foot + radius * np.column_stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)])
        canvas.lines(np.stack([arc[:-1], arc[1:]], axis=1), color, 3)
        canvas.lines(np.array([[foot, arc[0]], [foot, arc[-1]]]), color, 1)


def _draw_grasp(canvas: _Canvas, grasp: GraspMark) -> None:
    lines = grasp_lines(grasp)
    canvas.lines(lines, (20, 20, 20), 4)
    canvas.lines(lines, GRASP_COLOR, 2)


def _draw_handle(canvas: _Canvas, mark: HandleMark) -> None:
    handle = mark.handle
    middle, half = handle.pose.position, handle.length / 2 * handle.axis
    canvas.lines(np.array([[middle - half, middle + half]]), HANDLE_COLOR, 3)
    canvas.lines(np.array([[middle, middle + 0.12 * handle.opening_direction]]), (255, 230, 80), 2)
    if handle.hinge is not None and handle.hinge_direction is not None and handle.panel_size is not None:
        # Doors turn about an upright edge of their panel, flaps about a level one.
        upright = abs(float(handle.hinge_direction[2])) > 0.7
        reach = handle.panel_size[1 if upright else 0] / 2 * handle.hinge_direction
        canvas.lines(np.array([[handle.hinge - reach, handle.hinge + reach]]), (255, 230, 80), 1)
    joint = {"revolute": "door", "prismatic": "drawer"}.get(handle.joint or "", "handle")
    text = f"{mark.name} {handle.kind}, {joint} {handle.joint_confidence:.2f}, r {1e3 * handle.radius:.0f} mm"
    canvas.label(middle, text, HANDLE_COLOR)
