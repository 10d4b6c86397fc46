"""Runs Blender on a job, in a separate process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import coal
import numpy as np
import pinocchio

from bestman_bt.errors import InputError
from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Shape, Sphere
from bestman_bt.visualization.errors import RecordingError, VisualizationError
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot


def shape_document(shape: Shape) -> dict[str, Any]:
    """Return a shape as plain values; metres."""
    match shape:
        case Box():
            return {"kind": "box", "size": list(shape.size)}
        case Cylinder():
            return {"kind": "cylinder", "radius": shape.radius, "length": shape.length}
        case Sphere():
            return {"kind": "sphere", "radius": shape.radius}
        case Mesh():
            return {"kind": "mesh", "vertices": shape.vertices.tolist(), "faces": shape.faces.tolist()}


def pose_document(pose: Pose) -> list[float]:
    """Return position (metres) and quaternion xyzw as one list."""
    return [*map(float, pose.position), *map(float, pose.quaternion)]


def placed_document(placed: PlacedShape, color: Sequence[float] | None) -> dict[str, Any]:
    """Return a shape with its pose and rgba; without a colour it keeps that of its file."""
    return {
        "shape": shape_document(placed.shape),
        "pose": pose_document(placed.pose),
        "color": None if color is None else list(color),
    }


IMPORTED = (".obj", ".stl", ".ply")
"""Meshes that Blender reads itself, with their materials; others are read here, without materials."""


class BlenderRobot:
    """A URDF robot: ``urdf`` is its text with absolute mesh paths, ``base_frame`` the link whose pose is given."""

    def __init__(self, urdf: str, base_frame: str) -> None:
        try:
            self._links = ElementTree.fromstring(urdf).findall("link")
            self._model = pinocchio.buildModelFromXML(urdf)
        except (ElementTree.ParseError, RuntimeError, ValueError) as error:
            raise RecordingError(f"robot URDF: {error}") from error
        self._data = self._model.createData()
        self._base_frame = base_frame

    def link_poses(self, map_from_base: Pose, joint_positions: Mapping[str, float]) -> dict[str, Pose]:
        """Return the pose of every link in the map frame; unnamed joints are at 0."""
        model, data = self._model, self._data
        q = pinocchio.neutral(model)
        for name, value in joint_positions.items():
            if not model.existJointName(name):
                raise RecordingError(f"the robot {model.name!r} has no joint {name!r}")
            joint = model.joints[model.getJointId(name)]
            # A joint that turns without limits is kept as a point on the unit circle.
            q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        placed = {link.get("name", ""): self._root_from(link.get("name", "")) for link in self._links}
        map_from_root = map_from_base @ placed[self._base_frame].inverse()
        return {name: map_from_root @ pose for name, pose in placed.items()}

    def _root_from(self, link: str) -> Pose:
        placement = self._data.oMf[self._model.getFrameId(link)]
        quaternion = pinocchio.Quaternion(placement.rotation)
        return Pose(placement.translation, quaternion.coeffs())

    def document(self) -> list[dict[str, Any]]:
        """Return each link's name and visual shapes as plain values."""
        return [{"name": link.get("name", ""), "parts": list(_visuals(link))} for link in self._links]


def _visuals(link: ElementTree.Element) -> Iterator[dict[str, Any]]:
    for visual in link.findall("visual"):
        origin = visual.find("origin")
        xyz, rpy = _numbers(origin, "xyz", "0 0 0"), _numbers(origin, "rpy", "0 0 0")
        paint = visual.find("material/color")
        color = _numbers(paint, "rgba", "") if paint is not None else None
        (geometry,) = visual.findall("geometry/*")
        part = {"pose": pose_document(Pose.from_xyz_rpy(xyz, rpy)), "color": color}
        match geometry.tag:
            case "box":
                x, y, z = _numbers(geometry, "size", "")
                yield part | {"shape": shape_document(Box((x, y, z)))}
            case "cylinder":
                (radius,), (length,) = _numbers(geometry, "radius", ""), _numbers(geometry, "length", "")
                yield part | {"shape": shape_document(Cylinder(radius, length))}
            case "sphere":
                (radius,) = _numbers(geometry, "radius", "")
                yield part | {"shape": shape_document(Sphere(radius))}
            case "mesh":
                yield part | {"shape": _mesh(geometry)}


def _mesh(geometry: ElementTree.Element) -> dict[str, Any]:
    path = Path(geometry.get("filename", "").removeprefix("file://"))
    scale = _numbers(geometry, "scale", "1 1 1")
    if not path.is_absolute() or not path.is_file():
        raise RecordingError(f"robot URDF: mesh {str(path)!r} should be the absolute path of a file")
    if path.suffix.lower() in IMPORTED:
        return {"kind": "file", "path": str(path), "scale": scale}
    try:
        read = coal.MeshLoader().load(str(path), np.array(scale))
    except (RuntimeError, ValueError) as error:
        raise RecordingError(f"robot URDF: mesh {path}: {error}") from error
    faces = [[read.tri_indices(i)[corner] for corner in range(3)] for i in range(read.num_tris)]
    return shape_document(Mesh(np.array(read.vertices()), np.array(faces)))


def _numbers(element: ElementTree.Element | None, key: str, default: str) -> list[float]:
    text = default if element is None else element.get(key, default)
    return [float(number) for number in text.split()]


Finish = Literal["wall", "furniture", "object", "person"]
"""The surface finish of a body; its colours are those of the body."""


@dataclass(frozen=True)
class BlenderBody:
    """A body of the scene and its finish."""

    body: RecordedBody
    finish: Finish


@dataclass(frozen=True)
class BlenderFrame:
    """``eye``, ``target``: metres, map frame; ``field_of_view``: vertical, degrees. ``file``: the PNG to write."""

    snapshot: RobotSnapshot
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float
    file: Path


@dataclass(frozen=True)
class BlenderJob:
    """A job for Blender. ``hidden``: bodies to omit, such as walls in front of the camera. ``samples``: light paths per
    pixel.
    """

    robot: BlenderRobot
    bodies: Sequence[BlenderBody]
    frames: Sequence[BlenderFrame]
    hidden: frozenset[str] = frozenset()
    width: int = 960
    height: int = 720
    samples: int = 32
    seed: int = 0

    def document(self) -> dict[str, Any]:
        """Return the job as plain values; poses are [x, y, z, qx, qy, qz, qw]."""
        return {
            "width": self.width,
            "height": self.height,
            "samples": self.samples,
            "seed": self.seed,
            "bodies": [_body(painted) for painted in self.bodies if painted.body.name not in self.hidden],
            "hidden": [_body(painted) for painted in self.bodies if painted.body.name in self.hidden],
            "robot": self.robot.document(),
            "frames": [self._frame(frame) for frame in self.frames],
        }

    def _frame(self, frame: BlenderFrame) -> dict[str, Any]:
        snapshot = frame.snapshot
        return {
            "file": str(frame.file),
            "eye": frame.eye,
            "target": frame.target,
            "field_of_view": frame.field_of_view,
            "bodies": _poses(snapshot.body_poses),
            "links": _poses(self.robot.link_poses(snapshot.map_from_base, snapshot.joint_positions)),
        }


def _body(painted: BlenderBody) -> dict[str, Any]:
    body = painted.body
    return {
        "name": body.name,
        "finish": painted.finish,
        "pose": pose_document(body.pose),
        "parts": [placed_document(*part) for part in zip(body.shapes, body.colors, strict=True)],
    }


def _poses(poses: Mapping[str, Pose]) -> dict[str, list[float]]:
    return {name: pose_document(pose) for name, pose in poses.items()}


# Blender as a Python module in a virtual environment of its own, made when a user asks for it.
# Blender is GPL-3.0; nothing of this package imports it: it runs as a program of its own, with a script and a job file.


BPY = "bpy==5.0.1"
PYTHON = (3, 11)
"""The Python that this Blender is built for."""
SIZE = "about 1 GB"
INSTALL_COMMAND = "bestman-bt render --install-blender"


class BlenderError(VisualizationError, InputError):
    """Blender is missing, cannot be installed, or did not render its frames."""


def environment_folder() -> Path:
    """Return ``$XDG_DATA_HOME/bestman-bt/blender``, or ``~/.local/share/bestman-bt/blender``."""
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "bestman-bt" / "blender"


def blender_python() -> Path:
    """Return the Python that has Blender: BESTMAN_BT_BLENDER_PYTHON, or that of the installation; else BlenderError."""
    given = os.environ.get("BESTMAN_BT_BLENDER_PYTHON")
    python = Path(given) if given else environment_folder() / "bin" / "python"
    if python.is_file():
        return python
    if given:
        raise BlenderError(f"BESTMAN_BT_BLENDER_PYTHON names {given}, and there is no such file")
    raise BlenderError(f"Blender is not installed for bestman-bt; {SIZE}, GPL-3.0, once: {INSTALL_COMMAND}")


def install_blender(report: Callable[[str], None]) -> Path:
    """Create the environment and install Blender into it from the Python package index. Returns its Python.

    Raises BlenderError; no files are left in that case.
    """
    folder = environment_folder()
    python = folder / "bin" / "python"
    steps = {
        f"an environment in {folder}": [_base_python(), "-m", "venv", "--clear", str(folder)],
        f"{BPY}, {SIZE}": [str(python), "-m", "pip", "install", "--quiet", BPY],
        "a first start": [str(python), "-I", "-c", "import bpy; print(bpy.app.version_string)"],
    }
    folder.parent.mkdir(parents=True, exist_ok=True)
    for what, command in steps.items():
        report(what)
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            shutil.rmtree(folder, ignore_errors=True)
            raise BlenderError(f"{what} failed:\n{last_lines(done.stderr or done.stdout)}")
    return python


def last_lines(text: str, count: int = 12) -> str:
    """Return the last lines of a program's output."""
    return "\n".join(text.strip().splitlines()[-count:])


def _base_python() -> str:
    """Return a Python of the version that Blender is built for."""
    if sys.version_info[:2] == PYTHON:
        return sys.executable
    name = f"python{PYTHON[0]}.{PYTHON[1]}"
    found = shutil.which(name)
    if found is None:
        raise BlenderError(f"{BPY} needs {name}, and it is not in PATH; this is Python {sys.version.split()[0]}")
    return found


SCRIPT = Path(__file__).parent / "script" / "paint_scene.py"
"""Script for Blender's Python; it is never imported here."""
FRAME_DONE = "bestman-bt: painted "


def paint(job: BlenderJob, python: Path, on_frame: Callable[[Path], None]) -> None:
    """Render all frames. ``python``: an interpreter with Blender. Raises BlenderError with Blender's last output."""
    with TemporaryDirectory() as name:
        file, errors = Path(name) / "job.json", Path(name) / "errors.txt"
        file.write_text(json.dumps(job.document(), allow_nan=False), encoding="utf-8")
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        with (
            errors.open("w", encoding="utf-8") as log,
            subprocess.Popen(
                [str(python), "-I", str(SCRIPT), str(file)], stdout=subprocess.PIPE, stderr=log, text=True,
                env=environment,
            ) as blender,
        ):  # fmt: skip
            assert blender.stdout is not None
            try:
                said = ""
                for line in blender.stdout:
                    said = (said + line)[-4000:]
                    if line.startswith(FRAME_DONE):
                        on_frame(Path(line.removeprefix(FRAME_DONE).rstrip("\n")))
            except BaseException:
                blender.kill()
                raise
        if blender.returncode != 0:
            output = last_lines(errors.read_text(encoding="utf-8", errors="replace") or said)
            raise BlenderError(f"Blender has failed ({blender.returncode}):\n{output}")
    missing = [frame.file for frame in job.frames if not frame.file.is_file()]
    if missing:
        raise BlenderError(f"Blender did not render {missing[0]}")
