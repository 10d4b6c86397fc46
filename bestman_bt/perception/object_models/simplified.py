"""Meshes of scanners have far more triangles than a camera could tell apart."""

from __future__ import annotations

from typing import Literal

import numpy as np
import trimesh

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command, open3d
from bestman_bt.messages import Mesh

MOST_TRIANGLES = 12_000
"""Edges of about 3 mm on an object as large as a mug."""


def simplified(mesh: Mesh, most: int = MOST_TRIANGLES, library: Literal["trimesh", "open3d"] = "trimesh") -> Mesh:
    """The mesh itself, or one of at most ``most`` triangles (Garland and Heckbert's quadric error metric, 1997).

    ``library``: whose implementation. MissingExtraError where its package is not installed.
    """
    if len(mesh.faces) <= most:
        return mesh
    if library == "open3d":
        module = open3d()
        corners = module.utility.Vector3dVector(mesh.vertices.copy())
        whole = module.geometry.TriangleMesh(corners, module.utility.Vector3iVector(mesh.faces.astype(np.int32)))
        fewer = whole.simplify_quadric_decimation(most)
        return Mesh(np.asarray(fewer.vertices).copy(), np.asarray(fewer.triangles).astype(np.int64))
    try:
        smaller = trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False).simplify_quadric_decimation(
            face_count=most
        )
    except ModuleNotFoundError as error:
        message = f"a mesh of more than {most} triangles needs {error.name}: {install_command('objects')}"
        raise MissingExtraError(message) from error
    return Mesh(np.asarray(smaller.vertices), np.asarray(smaller.faces))
