"""Movable objects from their YAML, with precomputed grasps from a JSON file beside it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from bestman_bt.configuration.checked import check, salvage
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.configuration.quantity import Color, Friction, Lengths3, Mass, Number, PositiveLength, Share
from bestman_bt.messages import Mesh, ObjectGrasp, ObjectModel, PlacedShape, Pose
from bestman_bt.scene.mesh_file import locate_mesh
from bestman_bt.scene.shape_file import ShapeConfig, convex_shapes, placed_shapes

SCALE = 0.015
"""Metres per unit of the meshes, as pybullet_data has it: longest sides of 90 to 150 mm."""


def random_shape_document(number: int) -> Document:
    """Return the object file of shape ``number``, 0 to 999: about seven convex lumps stuck together, 100 g, in its
    colour. Raises MeshError if pybullet_data is not installed.
    """
    place = f"package://pybullet_data/random_urdfs/{number:03d}/{number:03d}"
    urdf = ElementTree.parse(locate_mesh(f"{place}.urdf", Path())).getroot()
    color = next(element for element in urdf.iter("color")).get("rgba", "0.5 0.5 0.5 1")
    data = {
        "mass": 0.1,
        "color": [float(value) for value in color.split()[:3]],
        "friction": 0.8,
        "collision": [{"mesh": {"file": f"{place}.obj", "scale": SCALE}}],
    }
    return Document(data, {(): (f"random_{number:03d}", None)})


SMALLEST, LARGEST = 0.005, 1.0
"""Metres: limits of the longest side of an object; beyond them its units are likely to be wrong."""
Symmetry = Literal["none", "half turns", "quarter turns", "sixth turns", "eighth turns", "tenth turns", "any"]
SYMMETRY_ORDERS: dict[Symmetry, int] = {
    "none": 1,
    "half turns": 2,
    "quarter turns": 4,
    "sixth turns": 6,
    "eighth turns": 8,
    "tenth turns": 10,
    "any": 0,
}
_RANDOM = re.compile(r"random_(\d{3})")


@dataclass(frozen=True)
class ObjectFile:
    """A movable object; its frame is at the middle of the bounding box of its collision shapes, z up.

    ``collision``: solid shapes; non-convex ones are decomposed. ``visual``: shapes for cameras, if different.
    ``symmetry``: of rotations about z. ``grasps``: a file beside this one with precomputed grasps.
    """

    mass: Mass
    color: Color
    collision: tuple[ShapeConfig, ...]
    visual: tuple[ShapeConfig, ...] = ()
    friction: Friction = 0.8
    symmetry: Symmetry = "none"
    grasps: str = ""
    description: str = ""


def read_object(name: str | Path, asked_by: Problem | None = None) -> ObjectModel:
    """Return the object of a shipped name, of a file, or ``random_000`` to ``random_999``. Raises ConfigurationError.

    The latter are the random shapes of pybullet_data, see ``random_shape_document``.
    """
    match = _RANDOM.fullmatch(str(name))
    if match is not None:
        return object_of(str(name), random_shape_document(int(match[1])), Path())
    path = find_data("object", name, asked_by)
    return object_of(path.stem, read_document(path), path.parent)


def object_of(name: str, document: Document, folder: Path) -> ObjectModel:
    """Return the object that a document describes; meshes are relative to ``folder``. Raises ConfigurationError."""
    file, problems = salvage(document, ObjectFile)
    faults = ProblemCollector(problems)
    collision: tuple[PlacedShape, ...] = ()
    visual: tuple[PlacedShape, ...] = ()
    grasps: tuple[ObjectGrasp, ...] = ()
    with faults.step():
        collision = convex_shapes(file.collision, document, "collision", folder)
        if document.data["collision"] == []:
            raise ConfigurationError([document.problem(("collision",), "an object needs at least one shape")])
        whole = collision and not any(problem.field.startswith("collision") for problem in problems)
        longest = float(ObjectModel(name, (0.0, 0.0, 0.0), 1.0, 0.0, collision).size.max()) if whole else SMALLEST
        if not SMALLEST <= longest <= LARGEST:
            message = f"the longest side should be {SMALLEST * 1e3:g} mm to {LARGEST:g} m, got {longest:.4g} m"
            raise ConfigurationError([document.problem(("collision",), f"{message}; check units and scale")])
    with faults.step():
        seen, field = (file.visual, "visual") if document.data.get("visual") else (file.collision, "collision")
        visual = placed_shapes(seen, document, field, folder)
    with faults.step():
        if file.grasps:
            grasps = read_grasps(folder / file.grasps, document.problem(("grasps",), ""))
    faults.raise_if_any()
    seen = file.visual or file.collision
    colors = tuple(shape.color or file.color for shape in seen) if any(shape.color for shape in seen) else ()
    if not file.visual and not colors and not any(isinstance(placed.shape, Mesh) for placed in visual):
        visual = ()
    return _centred(
        ObjectModel(
            name=name,
            color=file.color,
            mass=file.mass,
            friction=file.friction,
            collision=collision,
            visual=visual,
            symmetry_order=SYMMETRY_ORDERS[file.symmetry],
            visual_colors=colors,
            grasps=grasps,
        )
    )


def _centred(model: ObjectModel) -> ObjectModel:
    middle = model.bounds().mean(axis=0)
    if abs(middle).max() < 1e-9:
        return model
    shift = Pose(-middle)
    return replace(
        model,
        collision=tuple(PlacedShape(placed.shape, shift @ placed.pose) for placed in model.collision),
        visual=tuple(PlacedShape(placed.shape, shift @ placed.pose) for placed in model.visual),
    )


@dataclass(frozen=True)
class GraspEntry:
    """An ObjectGrasp: ``xyz`` metres and ``quaternion`` (x, y, z, w) of object_from_tool."""

    xyz: Lengths3
    quaternion: tuple[Number, Number, Number, Number]
    width: PositiveLength
    quality: Share


@dataclass(frozen=True)
class GraspsFile:
    """Grasps of an object for one ``gripper`` (its description). ``grasps``: in the object's frame, best first."""

    gripper: str
    grasps: tuple[GraspEntry, ...]


def read_grasps(path: Path, asked_by: Problem) -> tuple[ObjectGrasp, ...]:
    """Return the grasps of a file. Raises ConfigurationError, at ``asked_by`` if it is missing or not JSON."""
    try:
        document = Document(json.loads(path.read_text(encoding="utf-8")), {(): (str(path), None)})
        return tuple(
            ObjectGrasp(Pose(np.array(grasp.xyz), np.array(grasp.quaternion)), grasp.width, grasp.quality)
            for grasp in check(document, GraspsFile).grasps
        )
    except ConfigurationError:
        raise
    except (OSError, ValueError) as error:
        message = f"cannot use the grasps of {path.name}: {error}"
        raise ConfigurationError([Problem(asked_by.source, asked_by.line, asked_by.field, message)]) from error


def grasps_json(gripper: str, grasps: Sequence[ObjectGrasp]) -> str:
    """Return the text for ``read_grasps``, with a line per grasp."""
    lines = [
        json.dumps(
            {
                "xyz": [round(float(v), 6) for v in grasp.object_from_tool.position],
                "quaternion": [round(float(v), 7) for v in grasp.object_from_tool.quaternion],
                "width": round(grasp.width, 6),
                "quality": round(grasp.quality, 4),
            }
        )
        for grasp in grasps
    ]
    body = ",\n    ".join(lines)
    return f'{{\n  "gripper": {json.dumps(gripper)},\n  "grasps": [\n    {body}\n  ]\n}}\n'
