"""bestman-bt object: from a mesh to an object that scenes hold and perception finds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from benchmarks.rendered_table import TrueObject, render_table
from bestman_bt.cli import object_command
from bestman_bt.messages import Cylinder, ObjectGrasp, PlacedShape, Pose
from bestman_bt.perception.detection.from_image import ModelRegistration
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.object_file import read_object
from tests.cli.command_line import Answer

Command = Callable[..., Answer]


@pytest.fixture
def step(folder: Path) -> Path:
    """Two blocks side by side, 90 × 60 × 80 mm, in millimetres and far from the origin."""
    low = trimesh.creation.box((90.0, 60.0, 40.0)).apply_translation((0.0, 0.0, 20.0))
    high = trimesh.creation.box((30.0, 60.0, 40.0)).apply_translation((-30.0, 0.0, 60.0))
    path = folder / "step.stl"
    trimesh.util.concatenate([low, high]).apply_translation((400.0, -100.0, 10.0)).export(path)
    return path


def test_an_added_object_stands_in_scenes_and_is_found_there(bestman_bt: Command, folder: Path, step: Path) -> None:
    answer = bestman_bt(
        *("object", "add", step, "--name", "step", "--scale", "1 mm", "--color", ".7,.2,.5", "--mass", "250 g"),
        *("--into", "objects", "--json"),
    )
    assert answer.code == 0, answer.err
    facts = answer.document
    assert facts["size_m"] == [0.09, 0.06, 0.08]
    assert (facts["mass_kg"], facts["symmetry"], facts["watertight"]) == (0.25, "none", True)
    assert facts["convex_parts"] == 2
    assert facts["grasps"] > 10
    for file in facts["files"].values():
        assert (folder / file).is_file()
    picture = np.asarray(Image.open(folder / facts["files"]["picture"]))
    assert (np.abs(picture.astype(int) - 255).sum(axis=2) > 30).mean() > 0.05

    scene = folder / "scene.yaml"
    scene.write_text("extends: kitchen\nobjects: {cup: {model: objects/step.yaml}}\n")
    model = load_scene(scene).models["cup"]
    assert "cup" in {placed.name for placed in draw_world(load_scene(scene), 1).objects}
    assert len(model.grasps) == facts["grasps"]
    assert model.grasps[0].width <= 0.08

    table = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    for seed, yaw in enumerate((-0.5, 2.4)):
        true = table @ Pose.from_xyz_rpy((-0.1, 0.05, 0.04), (0.0, 0.0, yaw))
        rendered = render_table([TrueObject(model, true, True)], table, (0.8, 1.2), np.random.default_rng(seed))
        rival = read_object("box")
        found = ModelRegistration().detect(rendered.view, rendered.region, (model, rival), np.random.default_rng(0))
        assert [detection.name for detection in found.detections] == ["cup"]  # as its key in the scene
        pose = found.detections[0].pose
        assert np.linalg.norm(pose.position - true.position) < 0.004
        assert abs(math.remainder(pose.yaw - yaw, 2 * math.pi)) < math.radians(4.0)


@pytest.mark.slow
def test_an_object_is_replaced_only_by_force(bestman_bt: Command, folder: Path) -> None:
    trimesh.creation.box((0.04, 0.05, 0.06)).export(folder / "a.stl")
    add = ("object", "add", "a.stl", "--name", "a", "--into", ".")
    (folder / "a.yaml").write_text("mine")
    refused = bestman_bt(*add)
    assert refused.code == 2
    assert "a.yaml: already exists; --force replaces it" in refused.err
    assert (folder / "a.yaml").read_text() == "mine"
    assert sorted(path.name for path in folder.iterdir()) == ["a.stl", "a.yaml"]
    done = bestman_bt(*add, "--force")
    assert done.code == 0, done.err
    assert "40 × 50 × 60 mm, 60 g, symmetry: half turns, convex parts: 1" in done.out
    assert read_object(folder / "a.yaml").symmetry_order == 2


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("nowhere.stl", "--name", "a"), "nowhere.stl: no such mesh"),
        (("words.stl", "--name", "a"), "words.stl has no triangles"),
        (("ball.stl", "--name", "a"), "longest side would be 80 m, but should be 5 mm to 1 m; if its unit is mm"),
        (("ball.stl", "--name", "a", "--scale", "1e-6"), "longest side would be 8e-05 m"),
        (("torn.stl", "--name", "a", "--scale", "1mm"), "its surface is not closed (3 of 480 edges"),
        (("sheet.stl", "--name", "a", "--open"), "it is flat: a solid object is needed"),
        (("ball.stl", "--name", "a b"), "--name: a b: a name should be letters, digits, _ and -"),
        (("ball.stl", "--name", "random_001"), "not be random_000 to random_999"),
        (("ball.stl", "--name", "cup", "--scale", "1mm"), "--name: cup: another object has this name"),
        (("ball.stl", "--name", "a", "--scale", "1 kg"), "--scale: expected a length"),
        (("ball.stl", "--name", "a", "--mass", "-1 kg"), "--mass: should be more than 0"),
        (("ball.stl", "--name", "a", "--up", "w"), "--up: should be one of x, y, z, got 'w'"),
        (("ball.stl", "--name", "a", "--symmetry", "some"), "--symmetry: should be one of auto, none"),
        (("ball.stl", "--name", "a", "--color", "1,2,3"), "--color: should be three numbers of 0 to 1"),
        (("ball.stl", "--name", "a", "--color", "red"), "--color: should be three numbers R,G,B"),
        (("ball.stl", "--name", "a", "--robot", "dif_panda"), "did you mean 'diff_panda'?"),
    ],
)
def test_what_makes_no_object_is_refused_and_nothing_is_written(
    bestman_bt: Command, folder: Path, options: tuple[str, ...], told: str
) -> None:
    (folder / "words.stl").write_text("no mesh")
    ball = trimesh.creation.icosphere(subdivisions=2, radius=40.0)
    ball.export(folder / "ball.stl")
    trimesh.Trimesh(ball.vertices, ball.faces[1:]).export(folder / "torn.stl")
    trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]]).export(folder / "sheet.stl")
    before = sorted(folder.iterdir())
    answer = bestman_bt("object", "add", *options, "--into", "objects")
    assert answer.code == 2
    assert told in answer.err
    assert "Traceback" not in answer.err
    assert sorted(folder.iterdir()) == before


def test_an_object_of_ones_own_is_known_by_its_name(
    bestman_bt: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(folder / "data"))
    own = folder / "data/bestman-bt/objects"
    own.mkdir(parents=True)
    (own / "brick.yaml").write_text("mass: 1 kg\ncolor: [1, 0, 0]\ncollision: [{box: [10 cm, 5 cm, 5 cm]}]\n")
    (own / "stone.yaml").write_text("mass: 1 kg\ncolor: [1, 0, 0]\ncollision: []\n")
    listed = bestman_bt("object", "list", "--json").document
    names = {one["name"] for one in listed["objects"]}
    assert {"brick", "mug", "cup"} <= names
    assert "stone.yaml:3: collision" in listed["unavailable"]["stone"]
    assert "\nstone: not available: " in bestman_bt("object", "list").out
    assert bestman_bt("object", "show", "brick").out == (
        "brick: 100 × 50 × 50 mm, 1000 g, symmetry: none, convex parts: 1, grasps: 0\n"
    )
    assert "brick" in bestman_bt("object", "show", "brik").err


def test_show_draws_an_object_with_its_axes(bestman_bt: Command, folder: Path) -> None:
    assert bestman_bt("object", "show", "mug", "--png", "mug.png").code == 0
    picture = np.asarray(Image.open(folder / "mug.png")).astype(int)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    assert ((blue > red + 60) & (blue > green + 60)).sum() > 100  # the axis that points up
    assert ((red > blue + 100) & (green > blue)).sum() > 5000  # the orange mug


@pytest.mark.slow
def test_grasps_are_found_anew_and_named_in_the_file(bestman_bt: Command, folder: Path) -> None:
    (folder / "brick.yaml").write_text("mass: 1 kg\ncolor: [1, 0, 0]\ncollision: [{box: [10 cm, 5 cm, 5 cm]}]\n")
    assert bestman_bt("object", "grasps", "brick.yaml", "--json").document["grasps"] > 10
    assert (folder / "brick.yaml").read_text().endswith("\ngrasps: brick.grasps.json\n")
    once = (folder / "brick.grasps.json").read_text()
    assert bestman_bt("object", "grasps", "brick.yaml").code == 0
    assert (folder / "brick.grasps.json").read_text() == once
    assert (folder / "brick.yaml").read_text().count("grasps:") == 1


def test_without_grasps_it_is_said_how_far_the_gripper_opens_and_how_wide_the_object_is() -> None:
    gripper = object_command.gripper_of("diff_panda")[1]
    bowl, can = (replace(read_object(name), grasps=()) for name in ("bowl", "can"))
    opens = "no grasp was found: the gripper of diff_panda opens to 80 mm"
    drum = replace(bowl, collision=(PlacedShape(Cylinder(0.045, 0.09), Pose()),))
    assert object_command.why_no_grasps(drum, "diff_panda", gripper) == {
        "why_no_grasps": f"{opens}, its sides are 90 mm or more"
    }
    assert opens in object_command.why_no_grasps(can, "diff_panda", gripper)["why_no_grasps"]
    held = replace(can, grasps=(ObjectGrasp(Pose(), 0.05, 1.0),))
    assert object_command.why_no_grasps(held, "diff_panda", gripper) == {}
