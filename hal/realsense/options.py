"""What a robot's YAML may say about a RealSense camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from bestman_bt.configuration.quantity import PositiveTime

FrameRate = Annotated[int, Field(ge=1, le=90)]


@dataclass(frozen=True)
class RealSenseOptions:
    """Options of ``driver: realsense``; images have the size of the robot model's camera.

    ``serial``: which camera, where there are several. ``recording``: a file that the RealSense viewer or SDK has
    recorded, played again and again in place of a camera. ``frame_rate``: images per second. ``image_time``: seconds to
    wait for one.
    """

    serial: str = ""
    recording: str = ""
    frame_rate: FrameRate = 30
    image_time: PositiveTime = 2.0
