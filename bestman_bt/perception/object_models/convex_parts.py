"""Convex parts that fill a body, for physics.

CoACD (Wei, Liu, Ling and Su, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree
Search", 2022), by its authors' library.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command, open3d
from bestman_bt.messages import Mesh
from bestman_bt.perception.errors import PerceptionError

MOST_TRIANGLES = 12_000
"""Resolution that gives edges of about 3 mm on an object of the size of a mug."""


def simplified(mesh: Mesh, most: int = MOST_TRIANGLES, library: Literal["trimesh", "open3d"] = "trimesh") -> Mesh:
    """Return the mesh itself, or one of at most ``most`` triangles (Garland and Heckbert's quadric error metric, 1997).

    ``library``: implementation to use. Raises MissingExtraError if its package is not installed.
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


_DISAGREE = "the mesh cannot be closed: some of its triangles overlap, or do not agree on which side is outside"


def closed(mesh: Mesh) -> Mesh:
    """Return the mesh with a fan of triangles over each hole, around the middle of its border; unchanged without holes.

    Raises PerceptionError if the result is not a closed surface: triangles overlap, intersect or are oriented
    inconsistently.
    """
    directed = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there = {(int(a), int(b)) for a, b in directed}
    # The hole's side of a border edge runs the other way round.
    after: dict[int, list[int]] = {}
    for a, b in sorted(edge for edge in there if edge[::-1] not in there):
        after.setdefault(b, []).append(a)
    if not after:
        return _checked(mesh)
    vertices, fans = list(mesh.vertices), []
    for border in _loops(after):
        fans.append(np.column_stack([border, np.roll(border, -1), np.full(len(border), len(vertices))]))
        vertices.append(mesh.vertices[border].mean(axis=0))
    return _checked(Mesh(np.array(vertices), np.concatenate([mesh.faces, *fans])))


def _loops(after: dict[int, list[int]]) -> Iterator[NDArray[np.int64]]:
    """Yield the closed loops of border edges, each through a corner once; uses the edges up."""
    for start in sorted(after):
        while after[start]:
            way = [start]
            while len(way) > 1 or after[start]:
                onward = after.get(way[-1])
                if not onward:
                    raise PerceptionError(
                        "the mesh cannot be closed: its triangles do not agree on which side is outside"
                    )
                corner = onward.pop()
                if corner in way:  # holes that touch share a corner
                    first = way.index(corner)
                    yield np.array(way[first:])
                    way = way[: first + 1]
                else:
                    way.append(corner)


def bodies_of(mesh: Mesh) -> list[Any]:
    """Return the bodies of a mesh as trimesh.Trimesh; two that touch along an edge are two."""
    whole = trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)
    bodies: list[Any] = whole.split(only_watertight=False, repair=False)
    return bodies


def is_closed(mesh: Mesh) -> bool:
    """Return whether all bodies of the mesh are closed and their triangles consistently oriented."""
    return all(body.is_watertight and body.is_winding_consistent for body in bodies_of(mesh))


def _checked(mesh: Mesh) -> Mesh:
    if not is_closed(mesh):
        raise PerceptionError(_DISAGREE)
    return mesh


@dataclass(frozen=True)
class ConvexDecomposition:
    """Cuts bodies into convex parts.

    ``concavity``: CoACD's threshold, as a fraction of the size. ``most``: maximum number of parts. ``convex_share``: a
    body that fills this fraction of its convex hull is replaced by the hull. ``iterations``, ``nodes``, ``depth``: of
    the tree search; the library's own defaults take six times as long for parts that are hardly better. ``resolution``:
    samples per part.
    """

    concavity: float = 0.05
    most: int = 64
    convex_share: float = 0.98
    iterations: int = 40
    nodes: int = 10
    depth: int = 2
    resolution: int = 1000

    def parts(self, mesh: Mesh) -> tuple[Mesh, ...]:
        """Return convex meshes that together fill ``mesh``, whose corners are joined where triangles meet.

        Holes are closed first, and each body is decomposed separately. Raises PerceptionError if the mesh cannot be
        closed or encloses no volume. The same mesh gives the same parts.
        """
        mesh = closed(mesh)
        if mesh.volume < 1e-4 * float(np.ptp(mesh.vertices, axis=0).max()) ** 3:
            raise PerceptionError("the mesh encloses no volume: no convex parts can fill it")
        bodies = bodies_of(mesh)
        # A shell turned inwards is the inside of a hollow body: the two belong together.
        if any(body.volume <= 0.0 for body in bodies):
            bodies = [trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)]
        pieces = [piece for body in bodies for piece in self._cut(body)]
        hulls = [trimesh.convex.convex_hull(np.asarray(piece.vertices)) for piece in pieces]
        return tuple(Mesh(np.asarray(hull.vertices), np.asarray(hull.faces)) for hull in hulls if hull.volume > 0.0)

    def _cut(self, body: Any) -> list[Any]:
        if body.volume >= self.convex_share * body.convex_hull.volume:
            return [body]
        try:
            import coacd
        except ModuleNotFoundError as error:
            raise MissingExtraError(f"convex parts need coacd: {install_command('objects')}") from error

        coacd.set_log_level("error")
        pieces = coacd.run_coacd(
            coacd.Mesh(np.asarray(body.vertices), np.asarray(body.faces)),
            threshold=self.concavity,
            max_convex_hull=self.most,
            preprocess_mode="off",
            resolution=self.resolution,
            mcts_iterations=self.iterations,
            mcts_nodes=self.nodes,
            mcts_max_depth=self.depth,
            seed=0,
        )
        return [trimesh.Trimesh(vertices, faces, process=False) for vertices, faces in pieces]
