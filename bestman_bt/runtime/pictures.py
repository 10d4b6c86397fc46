"""Pictures for people: an object with its axes and grasps; one robot, or many on one sheet."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Box, Cylinder, ObjectGrasp, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.footprint import origin_pose, outline
from bestman_bt.robot_model.model import BaseModel, GripperModel, RobotModel
from bestman_bt.robot_model.urdf_elements import child_of, fixed_joint, link
from bestman_bt.scene.scene import World
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.robot import SimulatedRobot

Part = tuple[PlacedShape, tuple[float, float, float]]
AXES = (
    ((0.85, 0.1, 0.1), (0.0, math.pi / 2, 0.0)),
    ((0.1, 0.6, 0.1), (-math.pi / 2, 0.0, 0.0)),
    ((0.1, 0.2, 0.85), (0.0, 0.0, 0.0)),
)
"""Colours of the axes x, y and z, and the rotations that turn z to each of them."""
GRASP = (0.1, 0.55, 0.75)
SHOWN = slice(0, 20, 4)
"""Number of grasps to draw: the best ones overlap."""


def object_picture(model: ObjectModel, gripper: GripperModel | None = None, side: int = 420) -> NDArray[np.uint8]:
    """Return the object with its axes (x red, y green, z blue) and, given a gripper, its best grasps beside it.

    Returns (side, side or 2·side, 3) uint8.
    """
    simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
    size = float(np.linalg.norm(model.size))
    looks = list(model.appearance)
    panels = [simulated.render_object([*looks, *_axes(size)], _viewpoint(size), side, side)]
    if gripper is not None:
        forks = [part for grasp in model.grasps[SHOWN] for part in _fork(grasp, gripper)]
        panels.append(simulated.render_object([*looks, *forks], _viewpoint(1.35 * size), side, side))
    return np.concatenate(panels, axis=1)


def _viewpoint(size: float) -> Viewpoint:
    """Return the viewpoint from the front right above."""
    eye = 2.4 * size * np.array([0.62, -0.62, 0.48])
    return Viewpoint((float(eye[0]), float(eye[1]), float(eye[2])), (0.0, 0.0, 0.0), 32.0, near=0.2 * size)


def _axes(size: float) -> list[Part]:
    length, radius = 0.55 * size, 0.006 * size
    outwards = Pose(np.array([0.0, 0.0, length / 2]))
    return [
        (PlacedShape(Cylinder(radius, length), Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy) @ outwards), color)
        for color, rpy in AXES
    ]


def _fork(grasp: ObjectGrasp, gripper: GripperModel) -> list[Part]:
    """Return two fingers, the palm behind them and a piece of wrist: thin bars in the tool frame."""
    thick, depth = 0.002, gripper.part.finger_depth
    half = grasp.width / 2 + thick / 2
    ahead = gripper.part.pad_size[1] / 2
    bars = [
        (Box((thick, thick, depth + ahead)), (0.0, half, (ahead - depth) / 2)),
        (Box((thick, thick, depth + ahead)), (0.0, -half, (ahead - depth) / 2)),
        (Box((thick, 2 * half + thick, thick)), (0.0, 0.0, -depth)),
        (Box((thick, thick, 0.02)), (0.0, 0.0, -depth - 0.01)),
    ]
    return [(PlacedShape(box, grasp.object_from_tool @ Pose(np.array(place))), GRASP) for box, place in bars]


Picture = NDArray[np.uint8]
FROM = (1.0, -1.15, 0.45)
"""Directions from the robot to the camera: in front, to its right, above."""


def robot_picture(model: RobotModel, width: int = 480, height: int = 560, posture: str = "home") -> Picture:
    """Return an image of a robot on the floor, (height, width, 3) uint8; its joints are at zero without the posture."""
    positions = dict(model.postures.get(posture, {}))
    for gripper in model.of(GripperModel).values():
        positions |= gripper.joint_positions(gripper.max_width)
    lower, upper = _extent(model, positions)
    if not model.of(BaseModel):  # a part alone, perhaps below its root: held above the floor
        held = np.array([0.0, 0.0, 0.02 - lower[2]])
        lower, upper, model = lower + held, upper + held, _lifted(model, held)
    simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
    parameters = simulated.parameters_class(initial_postures=(posture,))
    robot = simulated(model, World("floor", 0, (), (), (), Pose2D(), {}), parameters=parameters)
    robot.connect()
    try:
        camera = ScenePhotographer(robot)
        centre = (lower + upper) / 2
        size = float(np.linalg.norm(upper - lower))
        direction = np.array(FROM) / np.linalg.norm(FROM)
        eye = centre + direction * max(0.25, 0.52 * size / math.tan(math.radians(20.0)))
        view = Viewpoint(tuple(eye.tolist()), tuple(centre.tolist()), field_of_view=40.0)
        return camera.picture(view, width, height)
    finally:
        robot.disconnect()


def contact_sheet(pictures: Sequence[tuple[str, Picture]], columns: int = 4) -> Picture:
    """Return equally sized pictures in rows, each with its name below it: (h, w, 3) uint8."""
    height, width = pictures[0][1].shape[:2]
    rows = math.ceil(len(pictures) / columns)
    columns = min(columns, len(pictures))
    sheet = Image.new("RGB", (columns * width, rows * (height + 24)), "white")
    pen = ImageDraw.Draw(sheet)
    for index, (name, picture) in enumerate(pictures):
        x, y = index % columns * width, index // columns * (height + 24)
        sheet.paste(Image.fromarray(picture), (x, y))
        pen.text((x + width / 2, y + height + 12), name, fill="black", anchor="mm", font_size=15)
    return np.asarray(sheet)


def _lifted(model: RobotModel, by: NDArray[np.float64]) -> RobotModel:
    robot = ET.fromstring(model.urdf)
    above = {child_of(joint) for joint in robot.findall("joint")}
    root = next(link.get("name", "") for link in robot.findall("link") if link.get("name") not in above)
    robot.insert(0, link("picture_stand"))
    robot.append(fixed_joint("picture_stand_joint", "picture_stand", root, by.tolist()))
    return replace(model, urdf=ET.tostring(robot, encoding="unicode"))


def _extent(model: RobotModel, positions: dict[str, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of the box around all shapes, (3,) metres each, as the robot is shown."""
    elements = list(ET.fromstring(model.urdf))
    links = [element for element in elements if element.tag == "link"]
    poses = link_poses(elements, positions, [element.get("name", "") for element in links])
    clouds = [np.zeros((1, 3))]
    for solid in links:
        for shape in solid.findall("visual"):
            corners = origin_pose(shape).apply(outline(shape.find("geometry")))
            clouds.append(poses[solid.get("name", "")].apply(corners))
    points = np.concatenate(clouds)
    return points.min(axis=0), points.max(axis=0)
