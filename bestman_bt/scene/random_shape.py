"""The thousand random shapes of pybullet_data as objects: things that no robot has a model of."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from bestman_bt.configuration import Document
from bestman_bt.scene.mesh_file import locate_mesh

SCALE = 0.015
"""Metres per unit of the meshes, as pybullet_data has it: longest sides of 90 to 150 mm."""


def random_shape_document(number: int, scale: float = SCALE) -> Document:
    """The object file of shape ``number``, 0 to 999: about seven convex lumps stuck together, 100 g, in its colour.

    ``scale``: metres per unit of the mesh. Raises MeshError where pybullet_data is not installed.
    """
    place = f"package://pybullet_data/random_urdfs/{number:03d}/{number:03d}"
    urdf = ElementTree.parse(locate_mesh(f"{place}.urdf", Path())).getroot()
    color = next(element for element in urdf.iter("color")).get("rgba", "0.5 0.5 0.5 1")
    data = {
        "mass": 0.1,
        "color": [float(value) for value in color.split()[:3]],
        "friction": 0.8,
        "collision": [{"mesh": {"file": f"{place}.obj", "scale": scale}}],
    }
    return Document(data, {(): (f"random_{number:03d}", None)})
