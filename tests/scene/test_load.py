"""Reading scenes: overrides, variants, and what is said about bad files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import Mesh
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.object_file import read_object


def problems(scene: str | Path, overrides: dict[str, object] | None = None) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        load_scene(scene, overrides)
    return [str(problem) for problem in error.value.problems]


def variant(folder: Path, text: str) -> Path:
    path = folder / "variant.yaml"
    path.write_text("extends: kitchen\n" + text)
    return path


def test_finger_friction_can_be_overridden_for_a_control_experiment() -> None:
    assert draw_world(load_scene("kitchen"), 0).finger_friction is None
    assert draw_world(load_scene("kitchen", {"finger_friction": 0.05}), 0).finger_friction == 0.05


def test_an_object_is_left_out_with_absent() -> None:
    scene = load_scene("kitchen", {"objects.cup": "absent"})
    assert "cup" not in {o.name for o in draw_world(scene, 0).objects}
    assert "cup" in scene.models  # the robot still knows what a cup is


def test_an_override_reaches_into_a_placement() -> None:
    scene = load_scene("kitchen", {"objects.can.presence": 0.0, "objects.cup.region.x": ["-20 cm", "-20 cm"]})
    for seed in range(20):
        world = draw_world(scene, seed)
        assert "can" not in {o.name for o in world.objects}
        cup = next(o for o in world.objects if o.name == "cup")
        table = next(f for f in world.furniture if f.name == "table")
        assert table.actual.inverse().apply(cup.pose.position[:2])[0] == pytest.approx(-0.2)


def test_the_only_thing_of_a_model_is_known_by_its_key_and_several_by_their_model(tmp_path: Path) -> None:
    scene = load_scene(variant(tmp_path, "objects: {pot: {model: mug, surface: table/top, at: [0, 50 cm, 0]}}\n"))
    assert {key: model.name for key, model in scene.models.items()} == {
        "cup": "cup", "pot": "pot", "can": "can", "counter_can": "can", "box": "box", "counter_box": "box"
    }  # fmt: skip


def test_a_scene_may_be_without_objects(tmp_path: Path) -> None:
    path = tmp_path / "room.yaml"
    path.write_text(
        "walls: {height: 2 m, thickness: 10 cm, lines: [[[-2, -2], [2, -2]]]}\n"
        "furniture: {table: {model: table, at: [1, 0, 0]}}\nrobot_start: {x: [-1, -1], y: [0, 0]}\n"
    )
    assert draw_world(load_scene(path), 0).objects == ()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("objects.cupp", "absent", "unknown key 'objects.cupp'; did you mean 'cup'?"),
        ("finger_frction", 0.1, "did you mean 'finger_friction'?"),
        ("objects.cup.surface", "tabel/top", "unknown surface 'tabel/top'; did you mean 'table/top'?"),
        ("objects.cup.model", "cap", "unknown object 'cap'; did you mean 'cup'?"),
        ("furniture.table.model", "tabel", "unknown furniture 'tabel'; did you mean 'table'?"),
        ("clearance", "8 kg", "expected a length in m (m, cm, mm), got '8 kg'"),
    ],
)
def test_a_bad_override_is_refused_with_the_remedy(key: str, value: object, message: str) -> None:
    (problem,) = problems("kitchen", {key: value})
    assert problem.startswith(f"--set scene.{key}={value}")
    assert message in problem


def test_an_unknown_scene_suggests_the_closest_one() -> None:
    assert problems("kitchn") == ["kitchn: unknown scene 'kitchn'; did you mean 'kitchen'?"]


def test_a_fault_in_a_variant_is_located_in_its_own_file(tmp_path: Path) -> None:
    path = variant(tmp_path, "clearance: 2 s\nwals: {}\n")
    found = problems(path)
    assert f"{path}:2: clearance: expected a length in m (m, cm, mm), got '2 s': 's' is a unit of time" in found
    assert f"{path}:3: wals: unknown field; did you mean 'walls'?" in found


def test_only_what_is_there_can_be_absent(tmp_path: Path) -> None:
    path = variant(tmp_path, "objects: {cop: absent}\n")
    assert problems(path) == [
        f"{path}:2: objects.cop: cannot be removed: the base scene has no such entry; did you mean 'cup'?"
    ]


def test_a_scene_that_extends_itself_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    path.write_text(f"extends: {path}\n")
    assert "extends itself" in problems(path)[0]


def test_an_object_needs_either_a_region_or_a_place(tmp_path: Path) -> None:
    path = variant(tmp_path, "objects: {cup: {at: [0, 0, 0]}}\n")
    assert problems(path) == [f"{path}:2: objects.cup.at: 'region' is given too; 'region: null' takes it away"]
    path = variant(tmp_path, "objects: {mug: {model: cup, surface: table}}\n")
    assert problems(path) == [f"{path}:2: objects.mug: one of 'region' and 'at' should be given"]
    path = variant(tmp_path, "objects: {cup: {at: [-20 cm, 0, 0], region: null}}\n")
    cup = next(o for o in draw_world(load_scene(path), 0).objects if o.name == "cup")
    assert cup.pose.position[2] == pytest.approx(0.80)


def test_the_cup_looks_hollow_and_collides_as_a_solid() -> None:
    cup = read_object("cup")
    (visual,) = cup.visual
    assert isinstance(visual.shape, Mesh)
    vertices, faces = visual.shape.vertices, visual.shape.faces
    np.testing.assert_allclose(vertices.min(axis=0), cup.bounds()[0], atol=1e-9)
    np.testing.assert_allclose(vertices.max(axis=0), cup.bounds()[1], atol=1e-9)
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    material = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6  # positive: every face turns outwards
    solid = np.pi * 0.033**2 * 0.100
    assert 0.05 * solid < material < 0.35 * solid


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "objects: {table: {model: cup, surface: table, at: [0, 0, 0]}}\n",
            "objects.table: the name 'table' is taken by a piece of furniture; choose another",
        ),
        (
            "objects: {robot: {model: cup, surface: table, at: [0, 0, 0]}}\n",
            "objects.robot: the name 'robot' is taken: ",
        ),
        ("furniture: {wall_0: {model: table, at: [1, 1, 0]}}\n", "furniture.wall_0: the name 'wall_0' is taken: "),
        (
            "objects: {cup: {region: {x: [12 cm, -28 cm]}}}\n",
            "objects.cup.region.x: the smaller limit comes first: [-28 cm, 12 cm], got [12 cm, -28 cm]",
        ),
        (
            "goals: {place: {region: {yaw: [90 deg, 0]}}}\n",
            "goals.place.region.yaw: the smaller limit comes first: [0, 90 deg], got [90 deg, 0]",
        ),
        ("robot_start: {y: [1, -1.5]}\n", "robot_start.y: the smaller limit comes first: [-1.5, 1], got [1, -1.5]"),
        (
            "walls: {lines: [[[0, 0], [0, 0]]]}\n",
            "walls.lines[0]: a wall needs two different ends, got [[0, 0], [0, 0]]",
        ),
        ("clearance: -8 cm\n", "clearance: should be greater than or equal to 0, got '-8 cm'"),
    ],
)
def test_what_no_world_can_be_made_of_is_refused_with_its_place(text: str, told: str, tmp_path: Path) -> None:
    path = variant(tmp_path, text)
    (problem,) = problems(path)
    assert problem.startswith(f"{path}:2: {told}")


def test_a_door_that_shall_stand_open_has_to_be_there_and_to_open_so_far() -> None:
    (unknown,) = problems("fridge_room", {"furniture.fridge.open": {"uper_door": "85 deg"}})
    assert "'fridge' has no door or drawer 'uper_door'; did you mean 'upper_door'?" in unknown
    (beyond,) = problems("fridge_room", {"furniture.fridge.open": {"upper_door": "150 deg"}})
    assert "opens from 0 to 108.9 deg, got 150 deg" in beyond
    (inwards,) = problems("chest_room", {"furniture.drawer_chest.open": {"drawer_1": "-2 cm"}})
    assert "opens from 0 to 32.8 cm, got -2 cm" in inwards


def test_all_faults_of_a_scene_are_reported_at_once_in_the_order_of_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "room.yaml"
    path.write_text(
        """walls: {height: 2 m, thickness: 10 cm, lines: [[[-2, -2], [2, -2]]]}
furniture:
  table: {model: table, at: [1, 0, 0]}
  desk: {model: table, at: [1, 0]}
  rack: {model: tabel, at: [1, 0], on: dseks/top}
robot_start: {x: [1, -1], y: [0, 0]}
objects:
  cup: {model: cup, surface: table/top, at: [0, 0, 0]}
  can: {model: can, surface: table/top, at: [1 cm, 0, 0]}
  box: {model: bx, surface: tabel/top, at: [0, 20 cm, 0]}
  mug: {model: mug, surface: table/top, at: [2.5, 0, 0]}
  bowl: {model: bowl, surface: desk/tpo, at: [0, 0, 0]}
  jar: {model: can, surface: rack/tpo, at: [0, 0, 0]}
goals:
  place: {model: cup, surface: table/top, region: {x: [1 m, 2 m], y: [0, 0]}}
colour: red
"""
    )
    found = problems(path)
    lines = [int(problem.split("yaml:")[1].split(":")[0]) for problem in found]
    assert lines == [4, 5, 5, 5, 6, 9, 10, 10, 11, 12, 15, 16]  # nobody knows the surfaces of the rack
    assert "furniture.rack.at: should have 3 entries, got [1, 0]" in found[1]
    assert "furniture.rack.model: unknown furniture 'tabel'; did you mean 'table'?" in found[2]
    assert "furniture.rack.on: unknown surface 'dseks/top'; did you mean 'desk/top'?" in found[3]
    assert "objects.can.at: stands 4.9 cm deep in 'cup'; each object needs its own place" in found[5]
    assert "objects.box.model: unknown object 'bx'; did you mean 'box'?" in found[6]
    assert "objects.box.surface: unknown surface 'tabel/top'; did you mean 'table/top'?" in found[7]
    assert "objects.mug.at: lies beside 'table/top', which reaches from -40 to 40 cm along its x" in found[8]
    assert "objects.bowl.surface: unknown surface 'desk/tpo'; did you mean 'desk/top'?" in found[9]
    assert "goals.place.region: lies beside 'table/top'" in found[10]


BENCH_ROOM = """walls: {height: 1 m, thickness: 8 cm, lines: [[[-2.5, -2.5], [3.0, -2.5]]]}
furniture:
  bench: {model: parts/bench.yaml, at: [2.2, 0.2, 0]}
  desk: {model: table, at: [0.2, 1.8, 90 deg]}
objects:
  cup: {model: cup, surface: bench/plate, at: [-20 cm, 10 cm, 0]}
robot_start: {x: [-1.5, -1.0], y: [-0.8, 0.2]}
"""


def bench_room(folder: Path, without: str = "\0") -> Path:
    """A scene with the bench of the page of scenes, less the lines that begin with ``without``."""
    page = (Path(__file__).parents[2] / "docs/scenes.md").read_text()
    bench = page.partition("```yaml\n# bench.yaml\n")[2].partition("```")[0]
    (folder / "parts").mkdir()
    lines = [line for line in bench.splitlines(keepends=True) if not line.startswith(without)]
    (folder / "parts/bench.yaml").write_text("".join(lines))
    (folder / "room.yaml").write_text(BENCH_ROOM)
    return folder / "room.yaml"


def test_furniture_of_ones_own_is_named_by_its_path_from_the_scene(tmp_path: Path) -> None:
    world = draw_world(load_scene(bench_room(tmp_path)), 3)
    (cup,) = world.objects
    assert [piece.name for piece in world.furniture] == ["bench", "desk"]
    assert cup.pose.position[2] == pytest.approx(0.75 + 0.05)


def test_a_fault_in_furniture_of_ones_own_is_located_in_its_file(tmp_path: Path) -> None:
    found = problems(bench_room(tmp_path, without="footprint:"))
    assert found == [f"{tmp_path / 'parts/bench.yaml'}:1: footprint: is missing"]


@pytest.mark.parametrize(("x", "beside"), [("40 cm", False), ("40.1 cm", True), ("-40 cm", False), ("-40.1 cm", True)])
def test_an_object_may_stand_up_to_the_edge_of_its_surface(tmp_path: Path, x: str, beside: bool) -> None:
    path = variant(tmp_path, f"objects: {{cup: {{at: [{x}, 0, 0], region: null}}}}")
    if beside:
        assert "objects.cup.at: lies beside 'table/top'" in problems(path)[0]
    else:
        load_scene(path)
