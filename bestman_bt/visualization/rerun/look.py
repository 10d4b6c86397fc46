"""Recording of a perception preview: images, clouds and all detections in 3D."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bestman_bt.extras import require_extra
from bestman_bt.messages import PointCloud, Pose, RGBDImage
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.marks import HANDLE_COLOR, OPENING_COLOR, SURFACE_COLOR, SceneMarks
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.beliefs import write_grasps, write_object
from bestman_bt.visualization.rerun.sensed import SensorRecording, write_cloud, write_image

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

BACKGROUND = (28, 31, 38)
CLOSER = 0.8
"""Distance of the viewpoint from the middle of the observed points, as a fraction of the camera's distance from it."""


@dataclass(frozen=True, eq=False)
class RecordedLook:
    """One picture: the camera, its pose in the map, and its points in the map."""

    camera: str
    image: RGBDImage
    map_from_camera: Pose
    cloud: PointCloud


def write_look(
    path: Path, looks: Sequence[RecordedLook], marks: SceneMarks, application_id: str = "bestman_bt"
) -> None:
    """Write ``path`` (``.rrd``). Raises RecordingError if that is not possible, MissingExtraError without rerun."""
    require_extra("a recording", "rerun")
    import rerun as rr

    recording = rr.RecordingStream(application_id, recording_id=path.stem)
    try:
        recording.save(path)
    except (RuntimeError, OSError) as error:
        raise RecordingError(f"the recording {path} cannot be written: {error}") from error
    recording.send_blueprint(_blueprint(looks, marks))
    recording.log(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    settings = SensorRecording()
    recording.set_time(entities.SIM_TIME, duration=min((look.image.stamp for look in looks), default=0.0))
    _write_marks(recording, marks)
    for number, look in enumerate(looks):
        recording.set_time(entities.SIM_TIME, duration=look.image.stamp)
        camera, entity = f"{look.camera}_{number}", _camera(look, number)
        k = look.image.intrinsics
        pose = look.map_from_camera
        recording.log(entity, rr.Transform3D(translation=pose.position, quaternion=rr.Quaternion(xyzw=pose.quaternion)))
        recording.log(
            entity,
            rr.Pinhole(
                image_from_camera=k.matrix,
                resolution=[k.width, k.height],
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=settings.frustum_length,
            ),
        )
        write_image(recording, camera, look.image, settings)
        write_cloud(recording, camera, look.cloud, settings)
    recording.flush()
    recording.disconnect()


def _blueprint(looks: Sequence[RecordedLook], marks: SceneMarks) -> rrb.Blueprint:
    """Return the scene on the left, seen from over the camera; the pictures on the right."""
    import rerun.blueprint as rrb

    found = [mark.pose.position for mark in marks.objects] + [mark.pose.position for mark in marks.surfaces]
    found += [mark.handle.pose.position for mark in marks.handles]
    middle = np.mean(found, axis=0) if found else np.zeros(3)
    cameras = [look.map_from_camera.position for look in looks] or [middle + np.array([-1.5, 0.0, 1.5])]
    eye = middle + CLOSER * (np.mean(cameras, axis=0) - middle)
    scene = rrb.Spatial3DView(
        origin=entities.WORLD,
        name="what was found",
        contents=["$origin/**", *(f"- {_camera(look, number)}/depth" for number, look in enumerate(looks))],
        background=BACKGROUND,
        eye_controls=rrb.EyeControls3D(position=eye.tolist(), look_target=middle.tolist(), eye_up=[0, 0, 1]),
    )
    pictures = [
        rrb.Spatial2DView(origin=_camera(look, number), contents=["$origin/rgb"], name=f"{look.camera} {number}")
        for number, look in enumerate(looks)
    ]
    parts = rrb.Horizontal(scene, rrb.Vertical(*pictures), column_shares=[3, 1]) if pictures else scene
    return rrb.Blueprint(parts, rrb.TimePanel(state="collapsed", timeline=entities.SIM_TIME), collapse_panels=True)


def _camera(look: RecordedLook, number: int) -> str:
    return entities.camera_entity(f"{look.camera}_{number}")


def _write_marks(recording: rr.RecordingStream, marks: SceneMarks) -> None:
    import rerun as rr

    for index, found in enumerate(marks.objects):
        name = f"{entities.SCENE}/objects/{entities.part(found.name)}"
        write_object(recording, name, index, found)
    for number, grasp in enumerate(marks.grasps):
        write_grasps(recording, f"{entities.SCENE}/grasps/{entities.part(grasp.target)}_{number}", [grasp])
    for mark in marks.handles:
        handle = mark.handle
        half = handle.length / 2 * handle.axis
        middle = handle.pose.position
        entity = f"{entities.SCENE}/handles/{entities.part(mark.name)}"
        bar = np.array([middle - half, middle + half], dtype=np.float32)
        recording.log(entity, rr.LineStrips3D([bar], colors=HANDLE_COLOR, radii=handle.radius, labels=[mark.name]))
        recording.log(
            f"{entity}/opening",
            rr.Arrows3D(origins=[middle], vectors=[0.15 * handle.opening_direction], colors=OPENING_COLOR, radii=0.004),
        )
    for surface in marks.surfaces:
        half_size = np.array([surface.size[0] / 2, surface.size[1] / 2, 0.002])
        recording.log(
            f"{entities.SCENE}/surfaces/{entities.part(surface.name)}",
            rr.Boxes3D(
                half_sizes=[half_size],
                centers=[surface.pose.position],
                quaternions=[surface.pose.quaternion],
                colors=SURFACE_COLOR,
                labels=[surface.name],
            ),
        )
