"""Detection: known objects by name, and other things by label."""

from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector, LabelledCluster
from bestman_bt.perception.detection.by_marker import (
    ByMarker,
    MarkerDetection,
    MarkerDetector,
    marker_shapes,
)
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.detection.from_image import FromImage, ImageDetection, ModelRegistration
from bestman_bt.perception.detection.onnx_detector import OnnxDetector
from bestman_bt.perception.detection.remote_detector import (
    RemoteDetector,
)

__all__ = [
    "ByMarker",
    "ColorShape",
    "DetectedScene",
    "Detection",
    "Detector",
    "FromImage",
    "ImageDetection",
    "LabelledCluster",
    "MarkerDetection",
    "MarkerDetector",
    "ModelRegistration",
    "OnnxDetector",
    "RemoteDetector",
    "marker_shapes",
]
