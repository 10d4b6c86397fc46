"""What goes wrong with cameras."""

from __future__ import annotations

from enum import StrEnum

from bestman_bt.perception import PerceptionError


class CameraErrorCode(StrEnum):
    """Why there is no usable image; skills put it into ``error_code``."""

    NO_IMAGE = "camera_no_image"
    BLACK = "camera_black"
    NO_DEPTH = "camera_no_depth"
    STALE = "camera_stale"


class CameraError(PerceptionError):
    """A camera delivered nothing, or nothing to work with; a skill that meets it fails with its code and words."""

    def __init__(self, code: CameraErrorCode, text: str) -> None:
        super().__init__(text)
        self.code = code
