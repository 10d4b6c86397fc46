"""A simulated robot over any physics engine: channels, sensors, and who watches that a run is honest."""

from hal.simulation.audit_record import AuditRecord, ContactIncident, DisturbanceEvent, Finding, Ledger, Penetration
from hal.simulation.bodies import BuiltWorld, ContactPoint, LinkMotion, SimulationError, Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.engine import Engine
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.guards import ReadPurpose
from hal.simulation.parameters import SimulationParameters
from hal.simulation.robot import SimulatedRobot
from hal.simulation.scene_recorder import SceneRecorder, SceneSnapshot
from hal.simulation.sensor_pipeline import SensorFault, SimulatedSensor

__all__ = [
    "AuditRecord",
    "BuiltWorld",
    "ContactIncident",
    "ContactPoint",
    "DisturbanceEvent",
    "DisturbanceInjector",
    "Engine",
    "Finding",
    "GroundTruth",
    "Ledger",
    "LinkMotion",
    "Penetration",
    "ReadPurpose",
    "ScenePhotographer",
    "SceneRecorder",
    "SceneSnapshot",
    "SensorFault",
    "SimulatedRobot",
    "SimulatedSensor",
    "SimulationError",
    "SimulationParameters",
    "Viewpoint",
]
