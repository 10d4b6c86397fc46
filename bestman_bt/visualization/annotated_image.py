"""A camera's picture with what was found in it: masks, boxes, axes with their uncertainty, handles, grasps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose, RGBDImage
from bestman_bt.visualization.canvas import Canvas
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

DEVIATIONS = 3.0
"""Standard deviations that the circle around an object's place shows."""
BEHIND = 0.03
"""Metres that a mark may lie behind what the camera measured and still be drawn: the far side of a thing."""
SHOWN = 0.15
"""Share of a thing that must be in sight for its marks to be drawn."""
OUTLINE_STEPS = 20
"""Samples along each side of a surface."""


def annotated_image(image: RGBDImage, frame_from_camera: Pose, marks: SceneMarks, scale: int = 2) -> NDArray[np.uint8]:
    """The picture, ``scale`` times as large, with all ``marks`` of the frame drawn into it; (H, W, 3) uint8 rgb.

    What the picture does not show, because something else is before it, is left out.
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
    """The outline where it is in sight, and its name at the lowest point of that, rather on the right."""
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
    """The arcs of possible directions of the object's x axis, around its foot."""
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
    """Points (N, 3) on the handle's front."""
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
