"""Detection: known objects by name, and other things by label."""

from bestman_bt.perception.detection.aruco import (
    MarkerDetection,
    MarkerDetector,
    MarkerDetectorParameters,
    marker_shapes,
)
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector, LabelledCluster
from bestman_bt.perception.detection.by_marker import ByMarker, ByMarkerParameters
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.detection.from_image import FromImage, FromImageParameters
from bestman_bt.perception.detection.image_detector import ImageDetection, ImageDetector
from bestman_bt.perception.detection.model_registration import ModelRegistration
from bestman_bt.perception.detection.onnx_detector import OnnxDetector, OnnxDetectorParameters, OnnxImageDetector
from bestman_bt.perception.detection.remote_detector import (
    RemoteDetector,
    RemoteDetectorParameters,
    RemoteImageDetector,
)

__all__ = [
    "ByMarker",
    "ByMarkerParameters",
    "ColorShape",
    "DetectedScene",
    "Detection",
    "Detector",
    "FromImage",
    "FromImageParameters",
    "ImageDetection",
    "ImageDetector",
    "LabelledCluster",
    "MarkerDetection",
    "MarkerDetector",
    "MarkerDetectorParameters",
    "ModelRegistration",
    "OnnxDetector",
    "OnnxDetectorParameters",
    "OnnxImageDetector",
    "RemoteDetector",
    "RemoteDetectorParameters",
    "RemoteImageDetector",
    "marker_shapes",
]
