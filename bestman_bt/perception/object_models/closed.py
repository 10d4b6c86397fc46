"""Surfaces with holes, closed: what a scanner could not see, mostly the bottom."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from bestman_bt.messages import Mesh
from bestman_bt.perception.errors import PerceptionError

_DISAGREE = "the mesh cannot be closed: some of its triangles overlap, or do not agree on which side is outside"


def closed(mesh: Mesh) -> Mesh:
    """The mesh with a fan of triangles over each hole, around the middle of its border; one without holes is itself.

    Raises PerceptionError where that gives no closed surface: triangles overlap, cross or do not agree on a side.
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
    """The closed ways along border edges, each through a corner once; uses the edges up."""
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
    """The bodies of a mesh as trimesh.Trimesh; two that touch along an edge are two."""
    whole = trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)
    bodies: list[Any] = whole.split(only_watertight=False, repair=False)
    return bodies


def is_closed(mesh: Mesh) -> bool:
    """Whether all its bodies are closed, and their triangles agree on which side is outside."""
    return all(body.is_watertight and body.is_winding_consistent for body in bodies_of(mesh))


def _checked(mesh: Mesh) -> Mesh:
    if not is_closed(mesh):
        raise PerceptionError(_DISAGREE)
    return mesh
