"""Sensor data: images of cameras, clouds, scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from bestman_bt.messages import CameraIntrinsics, LaserScan, PointCloud, Pose, RGBDImage
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.rerun import entities

if TYPE_CHECKING:
    import rerun as rr

SCAN_COLOR = (255, 80, 80)
CLOUD_COLOR = (240, 200, 80)


@dataclass(frozen=True)
class SensorRecording:
    """Limits of the recorded sensor data. ``depth_step``: metres; the noise of a camera does not compress below it."""

    jpeg_quality: int = 80
    depth_step: float = 0.004
    depth_range: tuple[float, float] = (0.2, 4.0)
    most_cloud_points: int = 20_000
    point_radius: float = 0.004
    frustum_length: float = 0.25


def write_camera(
    recording: rr.RecordingStream, camera: str, optical_frame: str, intrinsics: CameraIntrinsics, length: float
) -> None:
    """Write the frustum of a camera on a frame of the robot; images of this camera lie on its plane."""
    import rerun as rr

    entity = entities.camera_entity(camera)
    image_frame = f"image/{camera}"
    recording.log(
        entity,
        rr.Pinhole(
            image_from_camera=intrinsics.matrix,
            resolution=[intrinsics.width, intrinsics.height],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=length,
            parent_frame=entities.ROBOT_FRAME_PREFIX + optical_frame,
            child_frame=image_frame,
        ),
        static=True,
    )
    for part in ("rgb", "depth"):
        recording.log(f"{entity}/{part}", rr.CoordinateFrame(image_frame), static=True)


def write_image(recording: rr.RecordingStream, camera: str, image: RGBDImage, settings: SensorRecording) -> None:
    """Write colour as JPEG and depth as PNG in steps of ``depth_step``."""
    import rerun as rr

    entity = entities.camera_entity(camera)
    jpeg = _encoded(
        ".jpg", cv2.cvtColor(image.rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality]
    )
    recording.log(f"{entity}/rgb", rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
    steps = np.clip(np.round(image.depth / settings.depth_step), 0, np.iinfo(np.uint16).max).astype(np.uint16)
    png = _encoded(".png", steps, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    near, far = settings.depth_range
    recording.log(
        f"{entity}/depth",
        rr.EncodedDepthImage(
            png,
            media_type="image/png",
            meter=1.0 / settings.depth_step,
            depth_range=(near / settings.depth_step, far / settings.depth_step),
            colormap="turbo",
        ),
    )


def write_cloud(recording: rr.RecordingStream, name: str, cloud: PointCloud, settings: SensorRecording) -> None:
    """Write a cloud in the map frame, thinned evenly to ``most_cloud_points``."""
    import rerun as rr

    stride = max(1, -(-len(cloud) // settings.most_cloud_points))
    colors = CLOUD_COLOR if cloud.colors is None else cloud.colors[::stride]
    recording.log(
        f"{entities.SENSED}/{entities.part(name)}",
        rr.Points3D(cloud.points[::stride].astype(np.float32), colors=colors, radii=settings.point_radius),
    )


def write_scan(recording: rr.RecordingStream, name: str, scan: LaserScan, map_from_lidar: Pose) -> None:
    """Write the hits of a scan as points of the map."""
    import rerun as rr

    flat = scan.points()
    points = map_from_lidar.apply(np.column_stack([flat, np.zeros(len(flat))]))
    recording.log(
        f"{entities.SENSED}/{entities.part(name)}",
        rr.Points3D(points.astype(np.float32), colors=SCAN_COLOR, radii=0.008),
    )


def _encoded(extension: str, pixels: Any, options: list[int]) -> bytes:
    written, buffer = cv2.imencode(extension, pixels, options)
    if not written:
        raise RecordingError(f"image of shape {pixels.shape} and type {pixels.dtype} cannot be written as {extension}")
    return buffer.tobytes()
