"""A robot in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from bestman_bt.robot_model.model import LeggedBaseModel, RobotModel
from bestman_bt.scene.scene import World
from hal.mujoco.engine import MujocoEngine
from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.renderer import render_object
from hal.simulation.bodies import SimulationError
from hal.simulation.robot import SimulatedRobot

LEGS = "is a base on legs, which MuJoCo does not simulate here; the driver pybullet does"


class MujocoRobot(SimulatedRobot):
    """Implement ``SimulatedRobot``."""

    engine_name: ClassVar[str] = "MuJoCo"
    parameters_class = MujocoParameters
    render_object = staticmethod(render_object)
    _parameters: MujocoParameters

    @classmethod
    def refused_parts(cls, model: RobotModel) -> Mapping[str, str]:
        """Return the parts that MuJoCo does not simulate: bases on legs."""
        return dict.fromkeys(model.of(LeggedBaseModel), LEGS)

    def build(self, model: RobotModel, world: World, gui: bool) -> MujocoEngine:
        """Build the engine. Raises SimulationError for a window, which is not supported, and for unsupported models."""
        if gui:
            raise SimulationError("MuJoCo runs without a window here: leave --gui out, or take the driver pybullet")
        return MujocoEngine(model, world, self._parameters)
