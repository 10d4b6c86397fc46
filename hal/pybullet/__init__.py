"""The Robotics API over PyBullet: honest physics, no resets, no glue."""

from hal.pybullet.audit_record import AuditRecord, ContactIncident, DisturbanceEvent, Finding, Penetration
from hal.pybullet.client import ReadPurpose, SimulationError
from hal.pybullet.disturbance_injector import DisturbanceInjector
from hal.pybullet.ground_truth import GroundTruth
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.render import ScenePhotographer, Viewpoint, render_object
from hal.pybullet.robot import PyBulletRobot
from hal.pybullet.scene_recorder import SceneRecorder, SceneSnapshot
from hal.pybullet.sensor_pipeline import SensorFault, SimulatedSensor

__all__ = [
    "AuditRecord",
    "ContactIncident",
    "DisturbanceEvent",
    "DisturbanceInjector",
    "Finding",
    "GroundTruth",
    "Penetration",
    "PhysicsParameters",
    "PyBulletRobot",
    "ReadPurpose",
    "ScenePhotographer",
    "SceneRecorder",
    "SceneSnapshot",
    "SensorFault",
    "SimulatedSensor",
    "SimulationError",
    "Viewpoint",
    "render_object",
]
