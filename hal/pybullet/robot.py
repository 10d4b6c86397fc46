"""A robot in PyBullet."""

from __future__ import annotations

from typing import ClassVar

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.pybullet.client import PhysicsClient
from hal.pybullet.engine import PyBulletEngine
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.pictures import render_object
from hal.simulation.robot import SimulatedRobot


class PyBulletRobot(SimulatedRobot):
    """See ``SimulatedRobot``; ``client``: pybullet's functions, for code that sets up or disturbs a world with them."""

    engine_name: ClassVar[str] = "PyBullet"
    parameters_class = PhysicsParameters
    render_object = staticmethod(render_object)
    _parameters: PhysicsParameters
    client: PhysicsClient

    def build(self, model: RobotModel, world: World, gui: bool) -> PyBulletEngine:
        """Start and fill a physics server. Raises SimulationError if it cannot be started."""
        self.client = PhysicsClient()
        return PyBulletEngine(self.client, model, world, self._parameters, gui)
