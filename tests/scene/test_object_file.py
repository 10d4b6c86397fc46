"""Object files: shapes of every kind, and what is said about those that cannot be used."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bestman_bt.configuration.data import data_names
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import Mesh, ObjectModel, PlacedShape
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.generated_shapes import tube_mesh
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.object_file import read_object

SHIPPED = data_names("object")


def written(folder: Path, shapes: str, more: str = "") -> Path:
    path = folder / "thing.yaml"
    path.write_text(f"mass: 100 g\ncolor: [1, 0, 0]\n{more}collision: {shapes}\n")
    return path


def fault(folder: Path, shapes: str, more: str = "") -> str:
    with pytest.raises(ConfigurationError) as error:
        read_object(written(folder, shapes, more))
    (problem,) = error.value.problems
    return str(problem)


def solid(parts: tuple[PlacedShape, ...]) -> list[trimesh.Trimesh]:
    return [
        trimesh.Trimesh(placed.pose.apply(placed.shape.vertices), placed.shape.faces, process=False)
        for placed in parts
        if isinstance(placed.shape, Mesh)
    ]


def occupied(model: ObjectModel, point: tuple[float, float, float]) -> bool:
    """Whether a point of the object's frame lies in one of its convex parts."""
    return any(
        (part.face_normals @ np.array(point) <= (part.face_normals * part.triangles[:, 0]).sum(axis=1)).all()
        for part in solid(model.collision)
    )


def seen_bounds(model: ObjectModel) -> np.ndarray:
    seen = ObjectModel(model.name, model.color, 1.0, 1.0, tuple(placed for placed, _ in model.appearance))
    return seen.bounds()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_object_has_its_frame_in_the_middle_and_looks_as_large_as_it_is(name: str) -> None:
    model = read_object(name)
    np.testing.assert_allclose(model.bounds().mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(seen_bounds(model), model.bounds(), atol=6e-4)


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("name", [*SHIPPED, "random_000", "random_999"])
def test_what_collides_is_convex_and_what_is_seen_turns_outwards(name: str) -> None:
    model = read_object(name)
    for part in solid(model.collision):
        assert part.is_watertight
        assert part.volume == pytest.approx(part.convex_hull.volume, rel=1e-6)
    for surface in solid(tuple(placed for placed, _ in model.appearance)):
        assert surface.volume > 0.0


def test_the_mesh_of_the_shipped_cup_stays_as_it_is() -> None:
    (placed,) = read_object("cup").visual
    assert isinstance(placed.shape, Mesh)
    content = (placed.shape.vertices.round(9) + 0.0).tobytes() + placed.shape.faces.tobytes()
    assert hashlib.sha256(content).hexdigest() == "7458dcc70eff2a23c389eede1651d4cfce85f2f1d1a83ff3bd45c763b39c1813"


@pytest.mark.parametrize(("name", "middle"), [("mug", -0.0152), ("bowl", 0.0)])
def test_a_vessel_is_open_inside_for_physics_too(name: str, middle: float) -> None:
    model = read_object(name)
    bottom, top = model.bounds()[:, 2]
    assert not occupied(model, (middle, 0.0, top - 0.01))
    assert not occupied(model, (middle, 0.0, bottom + 0.02))
    assert occupied(model, (middle, 0.0, bottom + 0.003))


def test_a_finger_fits_into_the_handle_of_the_mug() -> None:
    model = read_object("mug")
    end = float(model.bounds()[1, 0])
    assert occupied(model, (end - 0.0055, 0.0, 0.0015))
    assert not any(occupied(model, (end - depth, 0.0, 0.0015)) for depth in (0.013, 0.02, 0.028))


def test_parts_of_an_object_have_colours_of_their_own() -> None:
    body, cap = (color for _, color in read_object("bottle").appearance)
    assert body == read_object("bottle").color
    assert cap == (0.90, 0.90, 0.88)


def test_a_tube_is_as_hollow_for_physics_as_for_cameras(tmp_path: Path) -> None:
    tube = written(tmp_path, "[{tube: {radius: 33 mm, length: 100 mm, wall: 3 mm, bottom: 5 mm}}]")
    model = read_object(tube)
    angles, heights = (
        grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 2 * np.pi, 97), np.linspace(-0.044, 0.049, 9))
    )

    def filled(radius: float) -> np.ndarray:
        """At which of the places on a circle of this radius some part is solid."""
        points = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), heights])
        return np.any([part_holds(part, points) for part in solid(model.collision)], axis=0)

    assert not filled(0.0).any()
    assert not filled(0.98 * np.cos(np.pi / 16) * 0.030).any()
    assert filled(0.0315).all()
    assert not filled(0.0331).any()


def part_holds(part: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Which points lie inside a convex part."""
    heights = np.einsum("fk,pfk->pf", part.face_normals, points[:, None] - part.triangles_center[None])
    return (heights < 1e-9).all(axis=1)


def test_a_random_shape_is_an_object_of_any_scene(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("extends: kitchen\nobjects: {cup: {model: random_017}}\n")
    cup = next(placed for placed in draw_world(load_scene(scene), 0).objects if placed.name == "cup")
    assert len(cup.model.collision) == 9
    assert cup.model.size == pytest.approx([0.0933, 0.0916, 0.0933], abs=1e-4)


def test_a_mesh_is_scaled_turned_upright_and_centred(tmp_path: Path) -> None:
    box = trimesh.creation.box((30.0, 50.0, 70.0)).apply_translation((5.0, -100.0, 7.0))
    box.export(tmp_path / "box.stl")
    model = read_object(written(tmp_path, "[{mesh: {file: box.stl, scale: 1 mm, up: y}}]"))
    assert model.size == pytest.approx([0.03, 0.07, 0.05])
    np.testing.assert_allclose(model.bounds().mean(axis=0), 0.0, atol=1e-9)
    model = read_object(written(tmp_path, "[{mesh: {file: box.stl, scale: 1 mm, up: x}}]"))
    assert model.size == pytest.approx([0.07, 0.05, 0.03])


@pytest.mark.parametrize(
    ("shapes", "told"),
    [
        ("[{mesh: {file: nowhere.stl}}]", "collision[0].mesh.file: no such mesh: nowhere.stl"),
        ('[{mesh: {file: "package://no_such_package/a.obj"}}]', "the package 'no_such_package' of"),
        ('[{mesh: {file: "package://pybullet_data/a.obj"}}]', "no such mesh: package://pybullet_data/a.obj"),
        ("[{mesh: {file: words.stl}}]", "the mesh words.stl has no triangles"),
        ("[{mesh: {file: words.xyzzy}}]", "cannot read the mesh words.xyzzy"),
        ("[{mesh: {file: bent.stl}}]", "part 0 of bent.stl is not convex"),
        ("[{mesh: {file: sheet.stl}}]", "part 0 of sheet.stl is flat"),
        ("[{mesh: {file: ball.stl}}]", "the longest side should be 5 mm to 1 m, got 60 m; check units and scale"),
        ("[{mesh: {file: ball.stl, scale: 0.01 mm}}]", "the longest side should be 5 mm to 1 m, got 0.0006 m"),
        ("[{mesh: {file: ball.stl, scale: 0}}]", "collision[0].mesh.scale: should be greater than 0"),
        ("[{mesh: {file: ball.stl, up: w}}]", "collision[0].mesh.up: should be 'x', 'y' or 'z', got 'w'"),
        ("[{box: [5 cm, 5 cm, 5 cm], sphere: 3 cm}]", "one of box, cylinder, sphere, tube, revolve, arc and mesh"),
        ("[{tube: {radius: 3 cm, length: 9 cm, wall: 3 cm, bottom: 1 cm}}]", "the wall should be thinner than"),
        ("[{arc: {radius: 3 cm, bar: 1 cm, start: 0, sweep: 0}}]", "the sweep between 0 and 355 deg"),
        ("[{revolve: {profile: [[0, 0], [3 cm, 0], [0, 5 cm]]}}]", "a profile has four points or more"),
        ("[{revolve: {profile: [[0, 0], [0, 1 cm], [3 cm, 1 cm], [0, 5 cm]]}}]", "have radius 0"),
        ("[{revolve: {profile: [[0, 5 cm], [3 cm, 5 cm], [3 cm, 0], [0, 0]]}}]", "goes the other way round"),
    ],
)
def test_shapes_that_cannot_be_are_reported_with_their_place(shapes: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "words.stl").write_text("no mesh")
    (tmp_path / "words.xyzzy").write_text("no mesh")
    bent = tube_mesh(radius=0.04, length=0.09, wall=0.003, bottom=0.004)
    trimesh.Trimesh(bent.vertices, bent.faces).export(tmp_path / "bent.stl")
    trimesh.Trimesh([[0, 0, 0], [50, 0, 0], [50, 50, 0], [0, 50, 0]], [[0, 1, 2], [0, 2, 3]]).export(
        tmp_path / "sheet.stl"
    )
    trimesh.creation.icosphere(radius=30.0).export(tmp_path / "ball.stl")
    assert told in fault(tmp_path, shapes)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "cannot use the grasps of grasps.json"),
        ("{", "cannot use the grasps of grasps.json"),
        ('{"gripper": "g", "grasps": [{"xyz": [0, 0, 0], "width": 0.03, "quality": 1}]}', "grasps[0].quaternion"),
        (
            '{"gripper": "g", "grasps": [{"xyz": [0, 0, 0], "quaternion": [0, 0, 0, 2], "width": 0.03, "quality": 1}]}',
            "unit (4,) array",
        ),
    ],
)
def test_grasps_that_cannot_be_read_are_reported(text: str | None, told: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "grasps.json").write_text(text)
    assert told in fault(tmp_path, "[{sphere: 3 cm}]", "grasps: grasps.json\n")
