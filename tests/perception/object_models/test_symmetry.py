"""Symmetry classes of shapes whose symmetry is known, however they are cut into triangles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from bestman_bt.messages import Mesh
from bestman_bt.perception.object_models.symmetry import SymmetrySearch
from bestman_bt.scene.object_file import read_object

create = trimesh.creation


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))


def joined(*shapes: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(shapes)


def seen(name: str) -> Mesh:
    return mesh_of(
        joined(
            *(
                trimesh.Trimesh(placed.pose.apply(placed.shape.vertices), placed.shape.faces)
                for placed, _ in read_object(name).appearance
                if isinstance(placed.shape, Mesh)
            )
        )
    )


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("sides", [12, 13, 16, 32, 97])
def test_a_cylinder_of_twelve_sides_or_more_looks_the_same_at_any_angle(sides: int) -> None:
    assert SymmetrySearch().order(mesh_of(create.cylinder(0.033, 0.1, sections=sides))) == 0


def test_of_turns_that_look_alike_the_exact_one_is_reported() -> None:
    assert SymmetrySearch().order(mesh_of(create.cylinder(0.028, 0.09, sections=8))) == 8  # tenth turns: 1.36 mm off


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(("sides", "order"), [(3, 1), (4, 4), (5, 1), (6, 6), (8, 8), (10, 10)])
def test_a_prism_turns_as_often_as_it_has_sides_and_not_at_all_for_an_odd_number(sides: int, order: int) -> None:
    assert SymmetrySearch().order(mesh_of(create.cylinder(0.05, 0.1, sections=sides))) == order


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("extents", "order"),
    [
        ((0.05, 0.05, 0.10), 4),
        ((0.05, 0.052, 0.10), 4),
        ((0.05, 0.055, 0.10), 2),
        ((0.06, 0.10, 0.12), 2),
        ((0.30, 0.304, 0.10), 2),
    ],
)
def test_a_box_turns_by_quarters_only_if_its_sides_agree_within_three_millimetres(
    extents: tuple[float, float, float], order: int
) -> None:
    assert SymmetrySearch().order(mesh_of(create.box(extents))) == order


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("subdivisions", [0, 3])
def test_the_triangles_do_not_matter(subdivisions: int) -> None:
    for shape, order in ((create.box((0.06, 0.1, 0.12)), 2), (create.cylinder(0.03, 0.1, sections=6), 6)):
        for _ in range(subdivisions):
            shape = shape.subdivide()
        assert SymmetrySearch().order(mesh_of(shape)) == order


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.3, 1.1])
def test_neither_do_the_yaw_and_the_place_that_a_mesh_is_given_in(turn: float) -> None:
    placed = trimesh.transformations.rotation_matrix(turn, [0, 0, 1]) @ trimesh.transformations.translation_matrix(
        [3.0, -2.0, 0.5]
    )
    assert SymmetrySearch().order(mesh_of(create.box((0.06, 0.1, 0.12)).apply_transform(placed))) == 2
    assert SymmetrySearch().order(mesh_of(create.cylinder(0.03, 0.1, sections=24).apply_transform(placed))) == 0


@pytest.mark.slow
def test_round_things_are_round() -> None:
    ring = create.torus(0.04, 0.01)
    lying = ring.copy().apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    assert SymmetrySearch().order(mesh_of(create.icosphere(radius=0.04))) == 0
    assert SymmetrySearch().order(mesh_of(ring)) == 0
    assert SymmetrySearch().order(mesh_of(lying)) == 2


@pytest.mark.slow
def test_a_small_feature_takes_the_symmetry_away() -> None:
    can = create.cylinder(0.033, 0.1, sections=48)
    knob = create.icosphere(radius=0.004).apply_translation((0.034, 0.0, 0.0))
    other = create.icosphere(radius=0.004).apply_translation((-0.034, 0.0, 0.0))
    assert SymmetrySearch().order(mesh_of(joined(can, knob))) == 1
    assert SymmetrySearch().order(mesh_of(joined(can, knob, other))) == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mug", "duck", "bottle", "bowl", "cup"])
def test_the_shipped_objects_report_what_their_meshes_show(name: str) -> None:
    surface = seen(name)
    assert SymmetrySearch().order(surface) == read_object(name).symmetry_order
    assert SymmetrySearch().order(surface) == SymmetrySearch().order(surface)
