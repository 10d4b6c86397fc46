"""Renders the frames of a run in Blender: few light paths and a denoiser, seconds per frame on a CPU."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix, Quaternion, Vector

sys.path.insert(0, str(Path(__file__).parent))
from finishes import Finishes
from lights import light_the_room
from shapes import imported_file, made_shape

BEVEL = 0.005
"""Largest radius at the edges of boxes, metres."""
F_STOP = 6.3


def main(path: str) -> None:
    """Build the scene once, then render every frame."""
    job = json.loads(Path(path).read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    finishes = Finishes()
    bodies = {body["name"]: build_body(body, finishes) for body in job["bodies"]}
    links = {link["name"]: build_link(link, finishes) for link in job["robot"]}
    light_the_room(finishes, job["bodies"] + job["hidden"])
    camera = make_camera(job)
    prepare_cycles(job)
    for frame in job["frames"]:
        for name, pose in frame["bodies"].items():
            if name in bodies:
                bodies[name].matrix_world = matrix(pose)
        for name, pose in frame["links"].items():
            links[name].matrix_world = matrix(pose)
        aim(camera, frame)
        bpy.context.scene.render.filepath = frame["file"]
        bpy.ops.render.render(write_still=True)
        sys.stdout.write(f"bestman-bt: painted {frame['file']}\n")
        sys.stdout.flush()


def matrix(pose: list[float]) -> Matrix:
    """Return the transform of [x, y, z, qx, qy, qz, qw]."""
    x, y, z, qx, qy, qz, qw = pose
    return Matrix.Translation(Vector((x, y, z))) @ Quaternion((qw, qx, qy, qz)).to_matrix().to_4x4()


def empty(name: str) -> Any:
    """Return an empty frame to attach shapes to."""
    frame = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(frame)
    return frame


def build_body(body: dict[str, Any], finishes: Finishes) -> Any:
    """Return a body of the scene at its start pose."""
    frame = empty(body["name"])
    frame.matrix_world = matrix(body["pose"])
    for part in body["parts"]:
        shape = made_shape(part["shape"], BEVEL)
        shape.data.materials.append(finishes.of_body(body["finish"], part["color"], part["shape"]))
        hang(shape, frame, part["pose"])
    return frame


def build_link(link: dict[str, Any], finishes: Finishes) -> Any:
    """Return a link of the robot; a colour in the URDF replaces that of a mesh file."""
    frame = empty(link["name"])
    for part in link["parts"]:
        if part["shape"]["kind"] == "file":
            for shape in imported_file(part["shape"]):
                finishes.of_mesh_file(shape, part["color"])
                hang(shape, frame, part["pose"], shape.matrix_world.copy())
            continue
        shape = made_shape(part["shape"], BEVEL)
        shape.data.materials.append(finishes.of_robot(part["color"] or [0.7, 0.7, 0.72, 1.0]))
        hang(shape, frame, part["pose"])
    return frame


def hang(shape: Any, frame: Any, pose: list[float], own: Matrix | None = None) -> None:
    """Attach a shape to a frame."""
    shape.parent = frame
    shape.matrix_parent_inverse = Matrix.Identity(4)
    shape.matrix_basis = matrix(pose) @ (own if own is not None else Matrix.Identity(4))


def make_camera(job: dict[str, Any]) -> Any:
    """Return a camera focused on its target."""
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "VERTICAL"
    data.dof.use_dof = True
    data.dof.aperture_fstop = F_STOP
    camera = bpy.data.objects.new("camera", data)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    return camera


def aim(camera: Any, frame: dict[str, Any]) -> None:
    """Aim the camera from the eye at the target, upright."""
    eye, target = Vector(frame["eye"]), Vector(frame["target"])
    camera.location = eye
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (target - eye).to_track_quat("-Z", "Y")
    camera.data.angle_y = math.radians(frame["field_of_view"])
    camera.data.dof.focus_distance = (target - eye).length


def prepare_cycles(job: dict[str, Any]) -> None:
    """Configure few light paths and a denoiser, for seconds per frame on a CPU."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = job["samples"]
    scene.cycles.seed = job["seed"]
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.02
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.cycles.denoising_quality = "BALANCED"
    scene.cycles.max_bounces = 6
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    scene.render.use_persistent_data = True
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - High Contrast"
    scene.view_settings.exposure = 0.0


if __name__ == "__main__":
    main(sys.argv[1])
