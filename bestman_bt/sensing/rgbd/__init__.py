"""RGB-D sensing."""

from bestman_bt.sensing.rgbd.errors import CameraError, CameraErrorCode
from bestman_bt.sensing.rgbd.rgbd_sensor import RGBDSensor, RGBDSensorParameters
from bestman_bt.sensing.rgbd.rgbd_view import RGBDView

__all__ = ["CameraError", "CameraErrorCode", "RGBDSensor", "RGBDSensorParameters", "RGBDView"]
