"""Generated furniture: what is asked for is there, and each true handle lies on the shapes that are seen."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import pytest

from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Sphere
from bestman_bt.scene.furniture_generator.generate import FURNITURE_KINDS, generate_furniture
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions
from bestman_bt.scene.scene import Articulation, FurnitureModel

SEEDS = range(12)
WITH_FRONTS = [kind for kind in FURNITURE_KINDS if kind != "shelf"]


def pieces(kind: str, **options: object) -> list[FurnitureModel]:
    return [generate_furniture(kind, np.random.default_rng(seed), **options) for seed in SEEDS]


def articulations(handle: str) -> list[Articulation]:
    return [
        articulation
        for kind in WITH_FRONTS
        for piece in pieces(kind, handle=HandleOptions(kind=handle))
        for articulation in piece.articulations
    ]


def inside(parts: Iterable[PlacedShape], points: np.ndarray, slack: float = 1e-9) -> np.ndarray:
    """Which of the points (N, 3) lie in one of the shapes."""
    within = np.zeros(len(points), dtype=bool)
    for part in parts:
        local = part.pose.inverse().apply(points)
        match part.shape:
            case Box():
                within |= np.all(np.abs(local) <= np.array(part.shape.size) / 2 + slack, axis=1)
            case Cylinder():
                lies_along = np.abs(local[:, 2]) <= part.shape.length / 2 + slack
                within |= (np.hypot(local[:, 0], local[:, 1]) <= part.shape.radius + slack) & lies_along
            case Sphere():
                within |= np.linalg.norm(local, axis=1) <= part.shape.radius + slack
            case _:
                raise AssertionError(part)
    return within


def assert_solid(articulation: Articulation, points: list[np.ndarray]) -> None:
    assert inside(articulation.parts, np.array(points)).all(), articulation.handle


def assert_free(articulation: Articulation, points: list[np.ndarray]) -> None:
    assert not inside(articulation.parts, np.array(points)).any(), articulation.handle


@pytest.mark.parametrize("kind", FURNITURE_KINDS)
def test_the_same_options_and_seed_give_the_same_piece(kind: str) -> None:
    first, second = (generate_furniture(kind, np.random.default_rng(5)) for _ in range(2))
    assert [part.shape for part in first.parts] == [part.shape for part in second.parts]
    assert first.colors == second.colors
    assert [a.handle.pose.position.tolist() for a in first.articulations] == [
        a.handle.pose.position.tolist() for a in second.articulations
    ]


def test_to_fix_an_option_changes_nothing_else() -> None:
    free, fixed = (
        generate_furniture("drawer_chest", np.random.default_rng(1), **options)
        for options in ({}, {"finish": FinishOptions(style="steel"), "width": 0.8})
    )
    assert fixed.footprint == (free.footprint[0], 0.8)
    assert [a.handle.kind for a in fixed.articulations] == [a.handle.kind for a in free.articulations]
    assert fixed.articulations[0].handle.radius == free.articulations[0].handle.radius


def test_a_bar_is_a_rod_of_the_handles_radius_and_length_that_stands_off_by_its_standoff() -> None:
    for articulation in articulations("bar"):
        handle = articulation.handle
        middle, out, side = handle.pose.position, handle.outward, handle.pose.rotation[:, 1]
        along = [middle + share * handle.length * handle.axis for share in np.linspace(-0.499, 0.499, 5)]
        inner = [point + 0.999 * handle.radius * to for point in along for to in (out, side, -side)]
        outer = [point + 1.001 * handle.radius * to for point in along for to in (out, side, -side)]
        ends = [middle + share * handle.length * handle.axis for share in (-0.501, 0.501)]
        panel, fingers = middle - (handle.standoff + 1e-4) * out, middle - (handle.standoff - 1e-3) * out
        assert_solid(articulation, [*inner, panel])
        assert_free(articulation, [*outer, *ends, fingers])


def test_a_knob_is_round_about_its_middle() -> None:
    for articulation in articulations("knob"):
        handle = articulation.handle
        x, y = handle.axis, handle.pose.rotation[:, 1]
        around = [np.cos(angle) * x + np.sin(angle) * y for angle in np.linspace(0.0, 2 * np.pi, 7)]
        panel = handle.pose.position - (handle.standoff + 1e-4) * handle.outward
        assert_solid(articulation, [*(handle.pose.position + 0.999 * handle.radius * to for to in around), panel])
        assert_free(articulation, [handle.pose.position + 1.001 * handle.radius * to for to in around])
        assert handle.length == pytest.approx(2 * handle.radius)


def test_behind_an_edge_and_beyond_it_there_is_room_for_fingers() -> None:
    for articulation in articulations("edge"):
        handle = articulation.handle
        out = handle.outward
        assert handle.panel is not None
        beyond = handle.pose.position - handle.panel.position
        beyond = beyond - (beyond @ out) * out
        beyond /= np.linalg.norm(beyond)  # towards the free border
        along = [handle.pose.position + x * handle.length * handle.axis for x in np.linspace(-0.49, 0.49, 5)]
        # the lip, as thick as twice the radius
        assert_solid(articulation, [point + z * handle.radius * out for point in along for z in (-0.999, 0.0, 0.999)])
        hooked = [point - (handle.radius + depth) * out for point in along for depth in (0.005, 0.015, 0.030)]
        assert_free(articulation, [point + 1.01 * handle.radius * out for point in along])
        assert_free(articulation, [point + 0.011 * beyond for point in along])
        assert_free(articulation, [point + shift * beyond for point in hooked for shift in (-0.015, 0.0, 0.030)])


@pytest.mark.parametrize("kind", WITH_FRONTS)
def test_a_handle_belongs_to_a_panel_of_its_door_or_drawer(kind: str) -> None:
    for piece in pieces(kind):
        for articulation in piece.articulations:
            handle = articulation.handle
            assert handle.panel is not None
            assert handle.panel_size is not None
            x, y, z = handle.panel.inverse().apply(handle.pose.position[None])[0]
            assert abs(x) < handle.panel_size[0] / 2
            assert abs(y) < handle.panel_size[1] / 2
            assert z == pytest.approx(handle.standoff)
            np.testing.assert_allclose(handle.outward, [-1.0, 0.0, 0.0], atol=1e-12)
            np.testing.assert_allclose(handle.panel.rotation[:, 0], [0.0, -1.0, 0.0], atol=1e-12)
            assert handle.joint == articulation.kind


@pytest.mark.parametrize("kind", WITH_FRONTS)
def test_a_handle_begins_to_move_as_its_joint_opens(kind: str) -> None:
    for articulation in itertools.chain.from_iterable(piece.articulations for piece in pieces(kind)):
        handle, step, axis = articulation.handle, 1e-6, np.array(articulation.axis)
        if articulation.kind == "prismatic":
            moved = step * axis
        else:
            arm = handle.pose.position - np.array(articulation.origin)
            turned = np.cos(step) * arm + np.sin(step) * np.cross(axis, arm) + (1 - np.cos(step)) * (axis @ arm) * axis
            moved = turned - arm
        np.testing.assert_allclose(moved / np.linalg.norm(moved), handle.opening_direction, atol=1e-5)
        assert handle.opening_direction @ handle.outward > 0.7


@pytest.mark.parametrize(
    ("kind", "options", "side"),
    [
        ("fridge", {"hinge": "left"}, "left"),
        ("fridge", {"hinge": "right"}, "right"),
        ("microwave", {"hinge": "left"}, "left"),
        ("dishwasher", {}, "bottom"),
    ],
)
def test_the_hinge_runs_along_the_border_opposite_to_the_handle(kind: str, options: dict, side: str) -> None:
    left, up = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    towards = {"left": left, "right": -left, "bottom": -up}[side]
    for piece in pieces(kind, **options):
        for articulation in piece.articulations:
            handle = articulation.handle
            assert handle.hinge_side == side
            assert handle.panel is not None
            assert handle.panel_size is not None
            half = handle.panel_size[0 if side in ("left", "right") else 1] / 2
            assert (handle.hinge - handle.panel.position) @ towards == pytest.approx(half)
            assert (handle.pose.position - handle.panel.position) @ towards < 0.0


@pytest.mark.parametrize("kind", WITH_FRONTS)
def test_nothing_of_a_closed_or_opening_door_is_inside_the_body(kind: str) -> None:
    rng = np.random.default_rng(0)
    for piece in pieces(kind)[:8]:
        for articulation in piece.articulations:
            for share in (0.0, 0.1, 0.5, 1.0):
                moved = opened(articulation, share * articulation.upper)
                points = np.vstack([samples(part, rng, 60) for part in articulation.parts])
                assert not inside(piece.parts, moved.apply(points), slack=-1e-4).any()


def opened(articulation: Articulation, position: float) -> Pose:
    """furniture_from_furniture: where the door's points go."""
    axis, origin = np.array(articulation.axis), np.array(articulation.origin)
    if articulation.kind == "prismatic":
        return Pose(position * axis)
    turn = Pose(np.zeros(3), np.append(np.sin(position / 2) * axis, np.cos(position / 2)))
    return Pose(origin) @ turn @ Pose(-origin)


def samples(part: PlacedShape, rng: np.random.Generator, count: int) -> np.ndarray:
    shape = part.shape
    half = {
        Box: lambda: np.array(shape.size) / 2,
        Cylinder: lambda: np.array([shape.radius * 0.7, shape.radius * 0.7, shape.length / 2]),
        Sphere: lambda: np.full(3, shape.radius * 0.57),
    }[type(shape)]()
    corners = np.array(list(itertools.product((-1, 1), repeat=3)))
    return part.pose.apply(np.vstack([corners, rng.uniform(-1.0, 1.0, (count, 3))]) * half)


@pytest.mark.parametrize("kind", FURNITURE_KINDS)
def test_surfaces_lie_on_solid_parts_and_nothing_stands_in_the_air_above_them(kind: str) -> None:
    rng = np.random.default_rng(1)
    for piece in pieces(kind)[:10]:
        assert piece.surfaces
        for surface in piece.surfaces:
            inner = rng.uniform(-0.49, 0.49, (40, 2)) * np.array(surface.size)
            points = surface.pose.apply(np.column_stack([inner, np.zeros(40)]))
            up = np.array([0.0, 0.0, 1.0])
            assert inside(piece.parts, points - 0.002 * up).all(), (kind, surface.name)
            assert not inside(piece.parts, points + 0.004 * up).any(), (kind, surface.name)


def test_all_kinds_of_handles_and_finishes_are_drawn() -> None:
    drawn = [a for kind in WITH_FRONTS for piece in pieces(kind) for a in piece.articulations]
    assert {a.handle.kind for a in drawn} == {"bar", "knob", "edge"}
    bars = [a.handle for a in drawn if a.handle.kind == "bar"]
    assert all(0.004 <= bar.radius <= 0.010 for bar in bars)
    assert all(0.025 <= bar.standoff <= 0.055 for bar in bars)
    assert all(0.08 <= bar.length <= 0.40 for bar in bars)
    assert {abs(round(float(bar.axis[2]))) for bar in bars} == {0, 1}
    same = [a.colors[0] == a.colors[-1] for a in drawn if a.handle.kind != "edge" and a.kind == "revolute"]
    assert 0.1 < np.mean(same) < 0.6


@pytest.mark.parametrize(
    ("kind", "options", "path", "message"),
    [
        ("wardrobe", {}, ("kind",), "unknown kind of furniture 'wardrobe'"),
        ("shelf", {"drawers": 2}, ("drawers",), "unknown option of a shelf"),
        ("shelf", {"boards": 1}, ("boards",), "should be from 2 to 8, got 1"),
        ("drawer_chest", {"drawers": 6, "height": 0.5}, ("drawers",), "6 drawers in 0.5 m leave fronts of 0.070 m"),
        ("drawer_chest", {"handle": HandleOptions(kind="knob", length=0.1)}, ("handle", "length"), "not length"),
        (
            "drawer_chest",
            {"width": 0.4, "handle": HandleOptions(kind="bar", length=0.5)},
            ("handle", "length"),
            "should be at most",
        ),
        ("fridge", {"handle": HandleOptions(kind="bar", radius=0.02, standoff=0.01)}, ("handle", "standoff"), "0.01"),
        ("cupboard", {"doors": 2, "hinge": "left"}, ("hinge",), "is for a single door"),
    ],
)
def test_options_that_cannot_be_are_refused_by_name(kind: str, options: dict, path: tuple, message: str) -> None:
    with pytest.raises(FurnitureOptionError) as error:
        generate_furniture(kind, np.random.default_rng(0), **options)
    assert error.value.path == path
    assert message in str(error.value)
