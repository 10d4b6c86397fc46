"""RGB-D sensing."""

from bestman_bt.sensing.rgbd.rgbd_sensor import RGBDSensor, RGBDView

__all__ = ["RGBDSensor", "RGBDView"]
