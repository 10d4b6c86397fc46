"""Detection of known objects by name."""

from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector

__all__ = ["DetectedScene", "Detection", "Detector"]
