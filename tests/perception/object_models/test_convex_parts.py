"""Convex parts fill a body, leave its hollows open and come out the same each time."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from bestman_bt.messages import Mesh
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.object_models.convex_parts import ConvexDecomposition, simplified


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))


def tray() -> trimesh.Trimesh:
    """100 × 80 × 40 mm outside, walls and bottom of 10 mm: one body of 28 triangles."""
    profile = [(0.05, 0.04, 0.0), (0.05, 0.04, 0.04), (0.04, 0.03, 0.04), (0.04, 0.03, 0.01)]
    corners = [(x * sx, y * sy, z) for x, y, z in profile for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    faces = [(0, 2, 1), (0, 3, 2), (12, 13, 14), (12, 14, 15)]
    for ring in range(3):
        for i in range(4):
            a, b = 4 * ring + i, 4 * ring + (i + 1) % 4
            faces += [(a, b, b + 4), (a, b + 4, a + 4)]
    return trimesh.Trimesh(corners, faces, process=False)


@pytest.fixture(scope="module")
def tray_parts() -> tuple[Mesh, ...]:
    return ConvexDecomposition().parts(mesh_of(tray()))


def solids(mesh: Mesh) -> list[trimesh.Trimesh]:
    return [trimesh.Trimesh(part.vertices, part.faces) for part in ConvexDecomposition().parts(mesh)]


def test_a_convex_body_is_its_own_part_and_bodies_are_parted() -> None:
    ball = trimesh.creation.icosphere(radius=0.03)
    box = trimesh.creation.box((0.02, 0.03, 0.04)).apply_translation((0.08, 0.0, 0.0))
    parts = solids(mesh_of(trimesh.util.concatenate([ball, box])))
    assert sorted(part.volume for part in parts) == pytest.approx(sorted([ball.volume, box.volume]))


def test_two_bodies_that_share_an_edge_are_two_parts() -> None:
    low = trimesh.creation.box((0.09, 0.06, 0.04))
    high = trimesh.creation.box((0.03, 0.06, 0.04)).apply_translation((-0.03, 0.0, 0.04))
    both = trimesh.util.concatenate([low, high])
    both.merge_vertices()
    assert not both.is_watertight  # that edge belongs to four triangles
    assert [part.volume for part in solids(mesh_of(both))] == pytest.approx([low.volume, high.volume])


@pytest.mark.slow
def test_a_tray_stays_open(tray_parts: tuple[Mesh, ...]) -> None:
    body = tray()
    assert body.is_watertight
    parts = [trimesh.Trimesh(part.vertices, part.faces) for part in tray_parts]
    assert len(parts) >= 5
    for part in parts:
        assert part.is_watertight
        assert part.volume == pytest.approx(part.convex_hull.volume, rel=1e-6)
    assert sum(part.volume for part in parts) == pytest.approx(body.volume, rel=0.1)
    together = np.concatenate([part.vertices for part in parts])
    np.testing.assert_allclose(np.ptp(together, axis=0), body.extents, atol=1e-4)
    middle = np.array([0.0, 0.0, 0.03])
    for part in parts:
        outside = ((middle - part.triangles[:, 0]) * part.face_normals).sum(axis=1)
        assert outside.max() > 0.0


@pytest.mark.slow
def test_the_same_mesh_gives_the_same_parts(tray_parts: tuple[Mesh, ...]) -> None:
    for a, b in zip(tray_parts, ConvexDecomposition().parts(mesh_of(tray())), strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)


def test_a_surface_with_holes_is_closed() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.03)
    torn = trimesh.Trimesh(ball.vertices, np.delete(ball.faces, [3, 100, 101], axis=0))
    assert not torn.is_watertight
    (part,) = solids(mesh_of(torn))
    assert part.volume == pytest.approx(ball.volume, rel=0.02)


def test_a_surface_that_cannot_be_closed_is_refused() -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.03)
    turned = ball.faces.copy()
    turned[7] = turned[7, ::-1]
    with pytest.raises(PerceptionError, match="cannot be closed"):
        ConvexDecomposition().parts(Mesh(ball.vertices, turned))


def test_what_encloses_nothing_is_refused() -> None:
    sheet = Mesh(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.0]]), np.array([[0, 1, 2]]))
    with pytest.raises(PerceptionError, match="no volume"):
        ConvexDecomposition().parts(sheet)


def test_a_fine_mesh_is_thinned_out_and_keeps_its_shape() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.04)
    fewer = simplified(mesh_of(ball), 4_000)
    assert len(fewer.faces) <= 4_000
    np.testing.assert_allclose(np.linalg.norm(fewer.vertices, axis=1), 0.04, atol=3e-4)
    assert simplified(fewer, 4_000) is fewer
