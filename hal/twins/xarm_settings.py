"""The settings of an xArm's control box, as made in UFACTORY Studio, and its identity."""

from __future__ import annotations

import math
import struct
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.robot_model.finger_linkage import link_poses
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of, payload

FIRMWARE = "v2.5.0"
OTHER_BATCH, OTHER_OFFSET, OTHER_LOAD, OTHER_LENGTH = "00000099", 5.0, 2.0, 5.0
"""Values set by faults: another serial number, millimetres, kilograms, millimetres."""


@dataclass
class XArmSettings:
    """Settings of a control box, in the units of the vendor's SDK.

    ``serial_number``: serial number of the arm. ``tool_offset``: mm and rad, from the flange. ``load``: kg, and the
    centre of mass in mm. ``gravity``: direction of gravity in the arm's base. ``length_error``: mm by which the real
    flange is farther out along its axis than in the controller's kinematics. ``keeps_load``: whether another load is
    acknowledged but ignored.
    """

    serial_number: str
    load: tuple[float, ...]
    tool_offset: tuple[float, ...] = (0.0,) * 6
    gravity: tuple[float, ...] = (0.0, 0.0, -1.0)
    length_error: float = 0.0
    keeps_load: bool = False
    _as_built: tuple[object, ...] = field(init=False, repr=False, default=())

    def __post_init__(self) -> None:
        self._as_built = self.serial_number, self.load, self.tool_offset, self.gravity, self.length_error

    @classmethod
    def of(cls, model: RobotModel, arm: str, serial_number: str) -> XArmSettings:
        """Return settings with the load of the hand and the mounting in the robot's file."""
        hand, base = payload(model, flange_of(model, arm)), model.of(ArmModel)[arm].base_frame
        poses = link_poses(list(ET.fromstring(model.urdf)), {}, (base, model.base_frame))
        gravity = (poses[base].inverse() @ poses[model.base_frame]).rotation @ np.array([0.0, 0.0, -1.0])
        return cls(serial_number, (hand.mass, *(1e3 * hand.centre).tolist()), gravity=tuple(gravity.tolist()))

    def faults(self) -> dict[str, Callable[[], None]]:
        """Return the faults of the settings, by name; ``as_built`` reverts all of them."""
        turned = tuple(-value for value in self.gravity)
        return {
            "other_serial": lambda: setattr(self, "serial_number", self.serial_number[:-8] + OTHER_BATCH),
            "other_tool": lambda: setattr(self, "tool_offset", (0.0, 0.0, OTHER_OFFSET, 0.0, 0.0, 0.0)),
            "kept_load": lambda: setattr(self, "keeps_load", True),
            "other_load": lambda: setattr(self, "load", (self.load[0] + OTHER_LOAD, *self.load[1:])),
            "other_mounting": lambda: setattr(self, "gravity", turned),
            "other_length": lambda: setattr(self, "length_error", OTHER_LENGTH),
            "as_built": self._restore,
        }

    def tool_pose(self, flange: tuple[float, ...]) -> tuple[float, ...]:
        """Return the pose of the tool for the flange at ``flange``: mm and roll, pitch, yaw."""
        at = _placement(flange) * pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, self.length_error]))
        tool = at * _placement(self.tool_offset)
        rotation: NDArray[np.float64] = tool.rotation
        return (*tool.translation.tolist(), *pinocchio.rpy.matrixToRpy(rotation).tolist())

    def set_load(self, data: bytes) -> None:
        """Execute ``set_tcp_load`` of the vendor's SDK: kg, and the centre of mass in mm, which reports then
        contain.
        """
        if not self.keeps_load:
            self.load = struct.unpack("<4f", data[:16])

    def _restore(self) -> None:
        self.keeps_load = False
        fields = ("serial_number", "load", "tool_offset", "gravity", "length_error")
        for name, value in zip(fields, self._as_built, strict=True):
            setattr(self, name, value)


def _placement(pose: tuple[float, ...]) -> pinocchio.SE3:
    if not all(map(math.isfinite, pose)):
        raise ValueError(f"a pose should be finite but is {pose}")
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(np.array(pose[3:])), np.array(pose[:3]))
