"""A calibration board as a link of a robot, to be drawn by simulated cameras."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Mesh, PlacedShape, Pose
from bestman_bt.perception.calibration.boards import CharucoBoard
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.runtime.calibration.robot_chain import written
from hal.pybullet.body_urdf import Color, body_urdf

PLATE, TILE = 0.006, 0.0006
"""Thickness of plate and tiles, metres."""
WHITE: Color = (0.97, 0.97, 0.97, 1.0)
BLACK: Color = (0.03, 0.03, 0.03, 1.0)
_CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def with_board(
    robot: RobotModel,
    board: CharucoBoard,
    holder: str,
    holder_from_board: Pose,
    carrier: Sequence[tuple[PlacedShape, Color]] = (),
) -> RobotModel:
    """Return the robot with a board bolted to the link ``holder``; its mass is negligible, and it collides with
    nothing.

    ``carrier``: additional shapes to draw, in the board frame: origin at a corner of the pattern, x along the columns,
    y along the rows, z away from the viewer.
    """
    body = ET.fromstring(body_urdf("calibration_board", 1e-3, (), [*_shapes(board), *carrier]))
    urdf = ET.fromstring(robot.urdf)
    link = body.find("link")
    assert link is not None
    inertia = link.find("inertial/inertia")
    assert inertia is not None
    inertia.attrib.update(dict.fromkeys(("ixx", "iyy", "izz"), "1e-6"))
    urdf.append(link)
    joint = ET.SubElement(urdf, "joint", name="calibration_board_joint", type="fixed")
    pose = written(holder_from_board)
    ET.SubElement(joint, "origin", xyz=_text(pose["xyz"]), rpy=_text(pose["rpy"]))
    ET.SubElement(joint, "parent", link=holder)
    ET.SubElement(joint, "child", link="calibration_board")
    return replace(robot, urdf=ET.tostring(urdf, encoding="unicode"))


def _text(values: list[float]) -> str:
    return " ".join(repr(value) for value in values)


def _shapes(board: CharucoBoard, margin: float = 0.012) -> list[tuple[PlacedShape, Color]]:
    """Return coloured shapes of the board in the board frame, z away from the viewer; ``margin``: white rim, metres."""
    width, height = board.size
    middle = Pose(np.array([width / 2, height / 2, PLATE / 2]))
    plate = PlacedShape(Box((width + 2 * margin, height + 2 * margin, PLATE)), middle)
    return [(plate, WHITE), (PlacedShape(_tiles(board), Pose()), BLACK)]


def _tiles(board: CharucoBoard) -> Mesh:
    per_square = _pixels_per_square(board)
    size = board.square / per_square
    boxes = [
        (_CORNERS * [(last - first) * size, size, TILE + 0.001] + [first * size, row * size, -TILE])
        for row, first, last in _runs(board.picture(per_square) < 128)
    ]
    offsets = 8 * np.arange(len(boxes))[:, None, None]
    return Mesh(np.concatenate(boxes), (_FACES[None] + offsets).reshape(-1, 3))


def _pixels_per_square(board: CharucoBoard) -> int:
    """Return the fewest pixels with which the markers' cells fall onto whole pixels."""
    cells = int(board.dictionary.split("_")[1].split("X")[0]) + 2
    for pixels in range(cells, 40 * cells):
        cell = pixels * board.marker / board.square / cells
        rim = (pixels - cell * cells) / 2
        if math.isclose(cell, round(cell), abs_tol=1e-6) and math.isclose(rim, round(rim), abs_tol=1e-6):
            return pixels
    return 20 * cells


def _runs(black: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Return row, first and past-the-last column of each run of black pixels."""
    padded = np.pad(black, ((0, 0), (1, 1))).astype(np.int8)
    rows, starts = np.nonzero(np.diff(padded, axis=1) == 1)
    _, ends = np.nonzero(np.diff(padded, axis=1) == -1)
    return list(zip(rows.tolist(), starts.tolist(), ends.tolist(), strict=True))
