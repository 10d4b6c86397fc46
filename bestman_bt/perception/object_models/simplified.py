"""Meshes of scanners have far more triangles than a camera could tell apart."""

from __future__ import annotations

import numpy as np
import trimesh

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.messages import Mesh

MOST_TRIANGLES = 12_000
"""Edges of about 3 mm on an object as large as a mug."""


def simplified(mesh: Mesh, most: int = MOST_TRIANGLES) -> Mesh:
    """The mesh itself, or one of at most ``most`` triangles (Garland and Heckbert's quadric error metric, 1997)."""
    if len(mesh.faces) <= most:
        return mesh
    whole = trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)
    try:
        smaller = whole.simplify_quadric_decimation(face_count=most)
    except ModuleNotFoundError as error:
        message = f"a mesh of more than {most} triangles needs {error.name}: {install_command('objects')}"
        raise MissingExtraError(message) from error
    return Mesh(np.asarray(smaller.vertices), np.asarray(smaller.faces))
