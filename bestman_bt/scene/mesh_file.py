"""Meshes of files: read with trimesh or Open3D, in metres, z up, as one surface or as convex parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from bestman_bt.configuration.data import no_pybullet_data, pybullet_data
from bestman_bt.configuration.quantity import PositiveLength
from bestman_bt.errors import Error
from bestman_bt.extras import open3d
from bestman_bt.messages import Mesh
from bestman_bt.scene.generated_shapes import convex_hull

MeshLibrary = Literal["trimesh", "open3d"]
CONVEX_SHARE = 0.95
"""A part that fills less of its convex hull than this is not convex."""
_PACKAGE = "package://"
_TURNS = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}


@dataclass(frozen=True)
class MeshConfig:
    """A mesh ``file``, relative to the YAML or ``package://python_package/path``. ``scale``: metres per unit of the
    file.

    ``up``: the axis of the file that points up when the object is upright.
    """

    file: str
    scale: PositiveLength = 1.0
    up: Literal["x", "y", "z"] = "z"


class MeshError(Error, ValueError):
    """A mesh that cannot be found, read or used."""


def locate_mesh(file: str, folder: Path) -> Path:
    """Return the file behind a path relative to ``folder`` or ``package://python_package/path``. Raises MeshError."""
    if file.startswith(_PACKAGE):
        package, _, inside = file.removeprefix(_PACKAGE).partition("/")
        path = _package_folder(package, file) / inside
    else:
        path = folder / file
    if not path.is_file():
        raise MeshError(f"no such mesh: {file}")
    return path


def _package_folder(package: str, file: str) -> Path:
    if package == "pybullet_data":
        models = pybullet_data()
        if models is None:
            raise MeshError(f"{file} {no_pybullet_data()}")
        return models
    spec = find_spec(package) if package.isidentifier() else None
    if spec is None or not spec.submodule_search_locations:
        raise MeshError(f"the package {package!r} of {file!r} is not installed")
    return Path(spec.submodule_search_locations[0])


def read_mesh(config: MeshConfig, folder: Path) -> Mesh:
    """Return the whole surface, rotated upright. Raises MeshError."""
    mesh = read_triangles(locate_mesh(config.file, folder))
    return Mesh(upright(mesh.vertices, config), mesh.faces)


def read_convex_parts(config: MeshConfig, folder: Path) -> tuple[Mesh, ...]:
    """Return the separate parts of a mesh, each of which must be convex. Raises MeshError."""
    groups = read_groups(locate_mesh(config.file, folder))
    parts = []
    for index, part in enumerate(part for group in groups for part in group.split(only_watertight=False, repair=False)):
        try:
            hull = convex_hull(np.asarray(part.vertices))
        except QhullError as error:
            raise MeshError(f"part {index} of {config.file} is flat, which physics cannot use") from error
        if not _is_convex(part, hull):
            raise MeshError(
                f"part {index} of {config.file} is not convex, which physics needs; 'bestman-bt object add' cuts a "
                "mesh into convex parts"
            )
        parts.append(Mesh(upright(hull.vertices, config), hull.faces))
    return tuple(parts)


def _is_convex(part: Any, hull: Mesh) -> bool:
    """Return whether a part is convex: by volume, or for a part with holes, which has none, by its
    corners on the hull.
    """
    if part.is_watertight:
        return abs(float(part.volume)) >= CONVEX_SHARE * hull.volume
    planes = ConvexHull(hull.vertices).equations
    depths = -(np.asarray(part.vertices) @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    return float(depths.max()) <= (1.0 - CONVEX_SHARE) * float(np.ptp(hull.vertices, axis=0).min())


def read_triangles(path: Path, library: MeshLibrary = "trimesh") -> Any:
    """Return a file as one trimesh.Trimesh with merged vertices and no degenerate triangles. Raises MeshError.

    ``library``: the reader. Raises MissingExtraError if Open3D is requested but not installed.
    """
    import trimesh

    geometries = _geometries(path) if library == "trimesh" else _geometries_by_open3d(path)
    return _cleaned(trimesh.util.concatenate(geometries))


def read_groups(path: Path) -> list[Any]:
    """Return the objects of a file (``o`` of an OBJ file), each in the format of ``read_triangles``. Raises
    MeshError."""
    return [_cleaned(mesh) for mesh in _geometries(path)]


def read_color(path: Path) -> tuple[float, float, float] | None:
    """Return the mean colour of a file's surface, rgb 0 to 1, or None without colours.

    Raises MeshError.
    """
    import trimesh

    total, area = np.zeros(3), 0.0
    try:
        scene: Any = trimesh.load_scene(path)
        for mesh in scene.dump():
            visual: Any = mesh.visual
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) and visual.defined:
                if visual.kind == "texture":
                    colors = np.asarray(visual.to_color().vertex_colors)[mesh.faces].mean(axis=1)
                else:
                    colors = np.asarray(visual.face_colors)
                total += mesh.area_faces @ colors[:, :3] / 255.0
                area += float(mesh.area)
    except Exception as error:
        raise MeshError(f"cannot read the colours of {path.name}: {error}") from error
    if area == 0.0:
        return None
    red, green, blue = (round(float(value), 3) for value in total / area)
    return (red, green, blue)


def write_groups(meshes: Sequence[Mesh], path: Path) -> None:
    """Write meshes as objects of one OBJ file, with separate vertices."""
    lines, first = [], 1
    for number, mesh in enumerate(meshes):
        lines.append(f"o part_{number}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + first]
        first += len(mesh.vertices)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _geometries(path: Path) -> list[Any]:
    import trimesh

    try:
        options: dict[str, Any] = {"split_object": True, "group_material": False} if path.suffix == ".obj" else {}
        scene: Any = trimesh.load_scene(path, process=False, skip_materials=True, **options)
        meshes = [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]
    except Exception as error:
        raise MeshError(f"cannot read the mesh {path.name}: {error}") from error
    if not meshes:
        raise MeshError(f"the mesh {path.name} has no triangles")
    if not all(np.isfinite(mesh.vertices).all() for mesh in meshes):
        raise MeshError(f"the mesh {path.name} has corners that are not finite")
    return [trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in meshes]


def _geometries_by_open3d(path: Path) -> list[Any]:
    import trimesh

    library = open3d()
    # Its read_triangle_mesh takes the first group of a file alone.
    with library.utility.VerbosityContextManager(library.utility.VerbosityLevel.Error):
        meshes = [part.mesh for part in library.io.read_triangle_model(str(path)).meshes]
    if not any(len(mesh.triangles) for mesh in meshes):
        raise MeshError(f"open3d read no triangles from {path.name}")
    if not all(np.isfinite(np.asarray(mesh.vertices)).all() for mesh in meshes):
        raise MeshError(f"the mesh {path.name} has corners that are not finite")
    return [trimesh.Trimesh(np.asarray(m.vertices), np.asarray(m.triangles), process=False) for m in meshes]


def _cleaned(mesh: Any) -> Any:
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces(height=0.0))
    mesh.remove_unreferenced_vertices()
    return mesh


def upright(vertices: NDArray[np.float64], config: MeshConfig) -> NDArray[np.float64]:
    """Return the vertices (N, 3) of a file in metres with z up; the origin is unchanged."""
    turned: NDArray[np.float64] = np.asarray(vertices) @ _TURNS[config.up].T
    return turned * config.scale
