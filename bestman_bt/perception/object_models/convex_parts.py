"""Convex parts that fill a body, for physics.

CoACD (Wei, Liu, Ling and Su, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree
Search", 2022), by its authors' library.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.messages import Mesh
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.object_models.closed import bodies_of, closed


@dataclass(frozen=True)
class ConvexDecomposition:
    """Cuts bodies into convex parts.

    ``concavity``: CoACD's threshold, as a share of the size. ``most``: parts. ``convex_share``: a body that fills
    this much of its hull is taken for its hull. ``iterations``, ``nodes``, ``depth``: of the tree search; the library's
    own defaults take six times as long for parts that are hardly better. ``resolution``: samples per part.
    """

    concavity: float = 0.05
    most: int = 64
    convex_share: float = 0.98
    iterations: int = 40
    nodes: int = 10
    depth: int = 2
    resolution: int = 1000

    def parts(self, mesh: Mesh) -> tuple[Mesh, ...]:
        """Convex meshes that together fill ``mesh``, whose corners are joined where triangles meet.

        Holes are closed first, and each body is cut on its own. Raises PerceptionError where the mesh cannot be closed
        or encloses no volume. The same mesh gives the same parts.
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
