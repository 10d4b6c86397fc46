"""Detection of known objects by name."""

from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector
from bestman_bt.perception.detection.model_registration import ModelRegistration, ModelRegistrationParameters

__all__ = ["DetectedScene", "Detection", "Detector", "ModelRegistration", "ModelRegistrationParameters"]
