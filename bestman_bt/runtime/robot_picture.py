"""Pictures of robots for people: one robot, or many on one sheet."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Pose2D
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.footprint import origin_pose, outline
from bestman_bt.robot_model.model import BaseModel, GripperModel, RobotModel
from bestman_bt.robot_model.urdf_elements import child_of, fixed_joint, link
from bestman_bt.scene.scene import World
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.robot import SimulatedRobot

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
