"""Camera models: from what a lens and a depth sensor deliver to ideal pinhole images."""

from bestman_bt.perception.camera_model.depth_correction import DepthCorrection
from bestman_bt.perception.camera_model.rectification import Rectification, rectification

__all__ = ["DepthCorrection", "Rectification", "rectification"]
