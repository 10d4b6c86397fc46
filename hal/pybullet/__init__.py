"""The Robotics API over PyBullet: honest physics, no resets, no glue."""

from hal.pybullet.client import SimulationError
from hal.pybullet.disturber import Disturber
from hal.pybullet.ground_truth import GroundTruth
from hal.pybullet.honesty_record import ContactIncident, Deed, Finding, HonestyRecord, Penetration
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.portrait import portrait
from hal.pybullet.reading_line import SensorFault
from hal.pybullet.render import ScenePhotographer, Viewpoint
from hal.pybullet.robot import PyBulletRobot
from hal.pybullet.scene_recorder import SceneRecorder, SceneSnapshot

__all__ = [
    "ContactIncident",
    "Deed",
    "Disturber",
    "Finding",
    "GroundTruth",
    "HonestyRecord",
    "Penetration",
    "PhysicsParameters",
    "PyBulletRobot",
    "ScenePhotographer",
    "SceneRecorder",
    "SceneSnapshot",
    "SensorFault",
    "SimulationError",
    "Viewpoint",
    "portrait",
]
