"""Import of an object from a mesh: checks, convex decomposition, symmetry, grasps, files."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml
from PIL import Image

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.document import read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.errors import MissingExtraError
from bestman_bt.messages import Mesh, ObjectModel
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.model_based import AntipodalModel
from bestman_bt.perception.object_models.convex_parts import ConvexDecomposition, is_closed, simplified
from bestman_bt.perception.object_models.symmetry import SymmetrySearch
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.runtime.pictures import object_picture
from bestman_bt.scene.mesh_file import (
    MeshConfig,
    MeshError,
    MeshLibrary,
    read_color,
    read_triangles,
    upright,
    write_groups,
)
from bestman_bt.scene.object_file import LARGEST, SMALLEST, SYMMETRY_ORDERS, Symmetry, grasps_json, read_object

DENSITY = 500.0
"""kg/m³, density of an object of unknown mass: wood, or a filled thin-walled container."""
GRASPS = 128
"""Largest number of grasps found for an object."""
GREY = (0.6, 0.6, 0.6)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_RESERVED = re.compile(r"random_\d{3}")
_UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0}


@dataclass(frozen=True)
class NewObject:
    """The description of an object besides its mesh.

    ``scale``: metres per unit of the mesh; ``up``: its axis that points up. ``mass``: kg, None: by ``DENSITY``.
    ``color``: rgb 0 to 1, None: that of the mesh. ``symmetry``: ``auto`` detects it. ``open_surface``: also accept a
    mesh with holes. ``library``: reads and simplifies the mesh.
    """

    name: str
    scale: float = 1.0
    up: Literal["x", "y", "z"] = "z"
    mass: float | None = None
    color: tuple[float, float, float] | None = None
    friction: float = 0.7
    symmetry: Symmetry | Literal["auto"] = "auto"
    open_surface: bool = False
    library: MeshLibrary = "trimesh"


@dataclass(frozen=True)
class ImportedObject:
    """The object for scenes, and its files: ``object``, ``mesh``, ``collision``, ``grasps``, ``picture``.

    ``watertight``: whether the mesh was. ``triangles``: number of triangles of the given mesh.
    """

    model: ObjectModel
    symmetry: Symmetry
    files: Mapping[str, Path]
    watertight: bool
    triangles: int


def import_object(
    mesh_file: Path, new: NewObject, gripper: GripperModel, gripper_name: str, folder: Path, replace: bool = False
) -> ImportedObject:
    """Write the files of an object into ``folder``, all or none.

    ``gripper``: to find grasps for; ``gripper_name``: its name, for people. Raises ConfigurationError, also if the
    object exists already.
    """
    files = {
        "object": folder / f"{new.name}.yaml",
        "mesh": folder / f"{new.name}.obj",
        "collision": folder / f"{new.name}.collision.obj",
        "grasps": folder / f"{new.name}.grasps.json",
        "picture": folder / f"{new.name}.png",
    }
    _check_name(new.name, files, replace)
    mesh, triangles, watertight = _checked_mesh(mesh_file, new)
    try:
        parts = ConvexDecomposition().parts(mesh)
    except (PerceptionError, MissingExtraError) as error:
        raise _fault(mesh_file, "", str(error)) from error
    symmetry = new.symmetry if new.symmetry != "auto" else _symmetry(mesh)
    entry = _entry(mesh_file, new, symmetry, parts)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".object_") as scratch:
        made = {kind: Path(scratch) / path.name for kind, path in files.items()}
        write_groups([mesh], made["mesh"])
        write_groups(parts, made["collision"])
        made["object"].write_text(yaml.safe_dump(entry, sort_keys=False, allow_unicode=True), encoding="utf-8")
        model = write_grasps(made["object"], gripper, gripper_name)
        Image.fromarray(object_picture(model, gripper)).save(made["picture"], optimize=True)
        for kind, path in files.items():
            made[kind].replace(path)
    return ImportedObject(model, symmetry, files, watertight, triangles)


def write_grasps(object_file: Path, gripper: GripperModel, gripper_name: str) -> ObjectModel:
    """Recompute the grasps of an object, write them to a file beside the object's and reference that file.

    Raises ConfigurationError for a file that is not an object.
    """
    model = read_object(object_file)
    grasps = AntipodalModel().grasps(model, gripper, np.random.default_rng(0), GRASPS)
    beside = f"{object_file.stem}.grasps.json"
    (object_file.parent / beside).write_text(grasps_json(gripper_name, grasps), encoding="utf-8")
    if "grasps" not in read_document(object_file).data:
        text = object_file.read_text(encoding="utf-8")
        object_file.write_text(f"{text.rstrip()}\ngrasps: {beside}\n", encoding="utf-8")
    return read_object(object_file)


def _fault(source: Path | str, field: str, message: str) -> ConfigurationError:
    return ConfigurationError([Problem(str(source), None, field, message)])


def _check_name(name: str, files: Mapping[str, Path], replace: bool) -> None:
    if not _NAME.fullmatch(name) or _RESERVED.fullmatch(name):
        message = "a name should be letters, digits, _ and -, begin with a letter, and not be random_000 to random_999"
        raise _fault("--name", name, message)
    there = [path for path in files.values() if path.exists()]
    if there and not replace:
        raise _fault(there[0], "", "already exists; --force replaces it")
    if name in data_names("object") and not files["object"].exists():
        raise _fault("--name", name, "another object has this name; choose a different one")


def _checked_mesh(mesh_file: Path, new: NewObject) -> tuple[Mesh, int, bool]:
    """Return the mesh in metres, z up, its bounding box about the origin; how many triangles were given; whether
    closed.
    """
    try:
        if not mesh_file.is_file():
            raise MeshError("no such mesh")
        triangles = read_triangles(mesh_file, new.library)
    except (MeshError, MissingExtraError) as error:
        raise _fault(mesh_file, "", str(error)) from error
    config = MeshConfig(str(mesh_file), new.scale, new.up)
    mesh = Mesh(upright(triangles.vertices, config), triangles.faces)
    extents = np.ptp(mesh.vertices, axis=0)
    longest = float(extents.max())
    if not SMALLEST <= longest <= LARGEST:
        limits = f"its longest side would be {longest:.4g} m, but should be {SMALLEST * 1e3:g} mm to {LARGEST:g} m"
        raise _fault(mesh_file, "", limits + _better_scale(longest / new.scale))
    if extents.min() < 1e-4:
        raise _fault(mesh_file, "", "it is flat: a solid object is needed")
    watertight = is_closed(mesh)
    if not watertight and not new.open_surface:
        edges, counts = np.unique(np.sort(triangles.edges, axis=1), axis=0, return_counts=True)
        loose = int((counts % 2 != 0).sum())
        message = (
            f"its surface is not closed ({loose} of {len(edges)} edges belong to one triangle), so it has no inside"
            if loose
            else "its triangles do not agree on which side is outside"
        )
        raise _fault(mesh_file, "", f"{message}; --open takes it as it is and closes it for physics only")
    if watertight and mesh.volume < 0.0:
        mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    centred = Mesh(mesh.vertices - (lower + upper) / 2, mesh.faces)
    return simplified(centred, library=new.library), len(triangles.faces), watertight


def _better_scale(longest: float) -> str:
    """Return a hint at the unit that would make an object of ordinary size, if there is one."""
    for unit, metres in _UNITS.items():
        if 0.03 <= longest * metres <= 0.5:
            return f"; if its unit is {unit} (--scale {metres:g}), that is {longest * metres:.3g} m"
    return "; --scale gives the metres per unit of the file"


def _symmetry(mesh: Mesh) -> Symmetry:
    order = SymmetrySearch().order(mesh)
    return next(name for name, of_name in SYMMETRY_ORDERS.items() if of_name == order)


def _entry(mesh_file: Path, new: NewObject, symmetry: Symmetry, parts: tuple[Mesh, ...]) -> dict[str, Any]:
    try:
        color = new.color or read_color(mesh_file) or GREY
    except MeshError as error:
        raise _fault(mesh_file, "", f"{error}; --color R,G,B gives one") from error
    mass = new.mass if new.mass is not None else max(0.01, round(DENSITY * sum(part.volume for part in parts), 3))
    return {
        "description": f"Made from {mesh_file.name}.",
        "mass": mass,
        "color": list(color),
        "friction": new.friction,
        "symmetry": symmetry,
        "collision": [{"mesh": {"file": f"{new.name}.collision.obj"}}],
        "visual": [{"mesh": {"file": f"{new.name}.obj"}}],
    }
