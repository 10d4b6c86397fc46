"""Doors and drawers of generated furniture: moving parts, axes and handles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestman_bt.messages import Handle, JointKind, Pose
from bestman_bt.messages.handle import HingeSide
from bestman_bt.scene.furniture_generator.handle_design import HandleDesign
from bestman_bt.scene.furniture_generator.panel import (
    Finish,
    FreeBorder,
    Panel,
    PanelHandle,
    front_with_handle,
    furniture_from_panel,
    surface,
)
from bestman_bt.scene.furniture_generator.solid import Point, Solid, block
from bestman_bt.scene.scene import Articulation

GAP = 0.002  # metres between a closed door and the body behind it
SEAM = 0.004  # metres between neighbouring fronts
_OPPOSITE: dict[HingeSide, FreeBorder] = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
# The axis about which a door that is hinged on a side turns towards -x, in the furniture frame.
_AXES: dict[HingeSide, Point] = {
    "left": (0.0, 0.0, -1.0),
    "right": (0.0, 0.0, 1.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
_BOX_WALL, _BOX_BOTTOM = 0.012, 0.008
_BOX_FOOT = 0.025  # metres from the lower border of the front to the bottom of the box


@dataclass(frozen=True)
class Front:
    """The face of a door or drawer: its middle in the furniture frame and its size; metres."""

    centre: Point
    width: float
    height: float


@dataclass(frozen=True)
class ArticulationDesign:
    """Parameters of the doors and drawers of a piece. ``thickness``: metres of the front. ``density``: kg/m³.

    ``friction``: of the joint, N or N m.
    """

    handle: HandleDesign
    finish: Finish
    thickness: float
    density: float
    friction: float


def door(
    name: str,
    front: Front,
    hinge_side: HingeSide,
    design: ArticulationDesign,
    *,
    upper: float,
    extra: Sequence[Solid] = (),
    latch: float = 0.0,
) -> Articulation:
    """Return a door that turns about a border of its front, in the middle of its thickness.

    ``extra``: more solids of the door, in the panel frame (a window).
    """
    panel = Panel(front.width, front.height, design.thickness, _OPPOSITE[hinge_side], closed_behind=True)
    solids, handle = front_with_handle(panel, design.handle, design.finish, centred=False)
    half_width, half_height = front.width / 2, front.height / 2
    on_panel = {
        "left": (-half_width, 0.0),
        "right": (half_width, 0.0),
        "top": (0.0, half_height),
        "bottom": (0.0, -half_height),
    }[hinge_side]
    pose = furniture_from_panel(front.centre)
    hinge = pose.apply(np.array([[*on_panel, -design.thickness / 2]]))[0]
    axis = np.array(_AXES[hinge_side])
    placed = pose @ handle.pose
    pulled = np.cross(axis, placed.position - hinge)
    truth = _handle(design.handle, front, pose, handle, pulled / np.linalg.norm(pulled), hinge_side, hinge, axis)
    joint = _ArticulationJoint("revolute", hinge, axis, upper)
    return replace(_articulation(name, joint, [*solids, *extra], pose, design, truth), latch=latch)


def drawer(
    name: str,
    front: Front,
    design: ArticulationDesign,
    *,
    depth: float,
    box_width: float,
    upper: float,
) -> Articulation:
    """Return a drawer: a front with an open box ``box_width`` × ``depth`` behind it, whose bottom is a surface of its
    name.
    """
    thickness, finish = design.thickness, design.finish
    panel = Panel(front.width, front.height, thickness, "top", closed_behind=False)
    solids, handle = front_with_handle(panel, design.handle, finish, centred=True)
    half, low = box_width / 2, -front.height / 2 + _BOX_FOOT
    high = low + 0.6 * front.height
    back = -thickness - depth
    solids += [
        block((-half, low, back), (half, low + _BOX_BOTTOM, -thickness), finish.body),
        block((-half, low, back), (-half + _BOX_WALL, high, -thickness), finish.body),
        block((half - _BOX_WALL, low, back), (half, high, -thickness), finish.body),
        block((-half, low, back), (half, high, back + _BOX_WALL), finish.body),
    ]
    pose = furniture_from_panel(front.centre)
    axis = np.array([-1.0, 0.0, 0.0])
    truth = _handle(design.handle, front, pose, handle, axis, None, None, None)
    joint = _ArticulationJoint("prismatic", np.array(front.centre), axis, upper)
    moving = _articulation(name, joint, solids, pose, design, truth)
    inner, floor = half - _BOX_WALL, front.centre[2] + low + _BOX_BOTTOM
    behind = front.centre[0] + thickness
    bottom = surface(name, (behind, behind + depth - _BOX_WALL), (-inner, inner), floor)
    return replace(moving, surfaces=(bottom,))


def _handle(
    design: HandleDesign,
    front: Front,
    furniture_from_front: Pose,
    handle: PanelHandle,
    opening_direction: np.ndarray,
    hinge_side: HingeSide | None,
    hinge: np.ndarray | None,
    hinge_direction: np.ndarray | None,
) -> Handle:
    return Handle(
        kind=design.kind,
        pose=furniture_from_front @ handle.pose,
        radius=handle.radius,
        length=handle.length,
        standoff=handle.standoff,
        opening_direction=opening_direction,
        confidence=1.0,
        position_std=0.0,
        joint="prismatic" if hinge_side is None else "revolute",
        joint_confidence=1.0,
        hinge_side=hinge_side,
        hinge=hinge,
        hinge_direction=hinge_direction,
        panel=furniture_from_front,
        panel_size=(front.width, front.height),
    )


@dataclass(frozen=True, eq=False)
class _ArticulationJoint:
    kind: JointKind
    origin: np.ndarray
    axis: np.ndarray
    upper: float


def _articulation(
    name: str,
    joint: _ArticulationJoint,
    solids: Sequence[Solid],
    pose: Pose,
    design: ArticulationDesign,
    handle: Handle,
) -> Articulation:
    placed = [solid.seen_from(pose) for solid in solids]
    return Articulation(
        name=name,
        kind=joint.kind,
        origin=_point(joint.origin),
        axis=_point(joint.axis),
        upper=joint.upper,
        parts=tuple(solid.placed for solid in placed),
        colors=tuple(solid.rgba for solid in placed),
        mass=design.density * sum(solid.volume for solid in solids),
        friction=design.friction,
        handle=handle,
    )


def _point(values: np.ndarray) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
