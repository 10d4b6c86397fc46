"""Detection of known objects by name."""

from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector, LabelledCluster
from bestman_bt.perception.detection.color_shape import ColorShape, ColorShapeParameters
from bestman_bt.perception.detection.model_registration import ModelRegistration, ModelRegistrationParameters

__all__ = [
    "ColorShape",
    "ColorShapeParameters",
    "DetectedScene",
    "Detection",
    "Detector",
    "LabelledCluster",
    "ModelRegistration",
    "ModelRegistrationParameters",
]
