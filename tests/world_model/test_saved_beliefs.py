"""What a run writes of the robot's beliefs is what a plan made later goes by."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.messages import Box, ObjectModel, PlacedShape, PointCloud, Pose, Pose2D, YawSet
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.runtime.world_file import read_world, write_world
from bestman_bt.task_planning.state import read_state
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief, ObjectChange, WorldModel

NASTY = 'mug", {on: fire}\n- SYSTEM: "open" the fridge'


@pytest.fixture(scope="module")
def setup() -> ResolvedConfig:
    settings = ["scene.clearance=9 cm"]
    return prepare(
        load_run(tree="plan_and_execute", scene="kitchen_furnished", robot="diff_panda", seed=2, settings=settings)
    )


@pytest.fixture
def world(setup: ResolvedConfig) -> WorldModel:
    """Beliefs of each kind."""
    world = setup.world_model.initial_beliefs()
    table = world.map.furniture["table"]
    world.map = world.map.with_furniture(
        dataclasses.replace(table, pose=Pose2D(3.21, -0.39, 0.01), position_error=0.005)
    )
    pose = Pose.from_xyz_rpy((3.1, -0.3, 0.81), (0.0, 0.0, 0.4))
    world.objects["mug"] = ObjectBelief(
        *("mug", world.models["mug"], pose, 0.9, 0.002, 41.5, "table/top", YawSet(((0.4, 0.1),)), 12.25)
    )
    box = ObjectModel(NASTY, (0.1, 0.2, 0.3), 0.1, 0.5, (PlacedShape(Box((0.05, 0.06, 0.07)), Pose()),))
    cloud = PointCloud(np.zeros((500, 3)))
    world.objects[NASTY] = ObjectBelief(NASTY, box, pose, 1.0, 0.01, 40.0, "counter", recognised=False, cloud=cloud)
    unfitted = dataclasses.replace(box, name="bowl")
    world.objects["bowl"] = ObjectBelief(
        "cup", unfitted, pose, 0.0, 0.01, 40.0, "counter", recognised=False, cloud=cloud
    )
    world.hands["arm"] = HeldObject("can", world.models["can"], Pose(np.array([0.0, 0.01, 0.02])), 0.053)
    world.articulations["drawer_chest/drawer_2"] = 0.28
    world.searched = {("cup", "table/top"): 30.0, ("cup", "shelf/top"): 5.0, ("mug", "shelf/top"): 3.0}
    world.changes.append(ObjectChange("removed", "cup", 10.0))
    world.given_places["bowl"] = "drawer_chest/drawer_3"
    world.locked.add("fridge/upper_door")
    world.in_the_way |= {("drawer_chest/drawer_2", "drawer_chest/top"), ("drawer_chest/drawer_2", "shelf/top")}
    return world


def test_what_is_read_is_believed_as_it_was_written(setup: ResolvedConfig, world: WorldModel, tmp_path: Path) -> None:
    write_world(tmp_path / "world.yaml", setup, world)
    file = read_world(tmp_path / "world.yaml")
    assert (file.scene, file.robot, file.seed) == ("kitchen_furnished", "diff_panda", 2)
    assert file.scene_settings == {"clearance": "9 cm"}
    read = file.world_model(setup)
    assert read_state(Beliefs(read)) == read_state(Beliefs(world))
    mug = read.objects["mug"]
    assert np.allclose(mug.pose.matrix, world.objects["mug"].pose.matrix, atol=1e-5)
    assert mug.yaw_set == YawSet(((0.4, 0.1),))
    assert (mug.stamp, mug.since, mug.confidence, mug.recognised) == (41.5, 12.25, 0.9, True)
    thing = read.objects[NASTY]
    assert thing.model.size.tolist() == [0.05, 0.06, 0.07]
    assert not thing.recognised
    assert not read.objects["bowl"].recognised, "a box is not the model whose name it has"
    held = read.hands["arm"]
    assert (held.name, held.width, held.model) == ("can", 0.053, setup.world_model.models["can"])
    table = read.map.furniture["table"]
    assert (table.pose, table.position_error) == (Pose2D(3.21, -0.39, 0.01), 0.005)
    assert read.map.furniture["counter"] is setup.world_model.map.furniture["counter"]


def test_a_search_from_before_a_thing_was_lost_is_not_kept(
    setup: ResolvedConfig, world: WorldModel, tmp_path: Path
) -> None:
    write_world(tmp_path / "world.yaml", setup, world)
    assert read_world(tmp_path / "world.yaml").beliefs.searched == {"cup": {"table/top": 30.0}}


def test_measurements_stay_out_of_the_file(setup: ResolvedConfig, world: WorldModel, tmp_path: Path) -> None:
    write_world(tmp_path / "world.yaml", setup, world)
    text = (tmp_path / "world.yaml").read_text()
    assert "cloud" not in text
    assert len(text) < 4000


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("openings: {drawer_chest/drawer_7: 0.2}", "no door or drawer 'drawer_chest/drawer_7'; did you mean"),
        ("openings: {drawer_chest/drawer_1: 3 kg}", "unit of mass"),
        ("locked: [fridge]", "no door or drawer 'fridge'"),
        ("in_the_way: {drawer_chest: []}", "no door or drawer 'drawer_chest'"),
        ("in_the_way: {drawer_chest/drawer_2: [tabel]}", "no surface 'tabel'; did you mean 'table'"),
        ("given_places: {mugg: table}", "no object 'mugg'; did you mean 'mug'?"),
        ("searched: {mug: {shelf: soon}}", "expected a time"),
        ("furniture: {tabel: {x: 0, y: 0, theta: 0, position_error: 0, heading_error: 0}}", "no furniture 'tabel'"),
        ("hands: {arm: {name: can, what: {}, tool_from_object: {position: [0, 0, 0]}, width: 0}}", "a model or a size"),
        ("objects: {a: {what: {size: [1, 1, 0]}, pose: {position: [0, 0, 0]}}}", "size"),
        ("base: {x: 0, y: 0}", "base.theta: is missing"),
        ("objets: {}", "unknown field; did you mean 'objects'"),
        ("told: {mug: table}", "told: unknown field; it is called 'given_places' now"),
        ("brought_about: []", "brought_about: unknown field; it is called 'achieved_effects' now"),
    ],
)
def test_what_is_wrong_in_a_file_is_reported_with_its_line(
    setup: ResolvedConfig, tmp_path: Path, line: str, words: str
) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(f"scene: kitchen_furnished\nbeliefs:\n  {line}\n")
    with pytest.raises(ConfigurationError, match=words) as refused:
        read_world(path).world_model(setup)
    assert refused.value.problems[0].source.endswith("world.yaml")
    assert refused.value.problems[0].line == 3


def test_what_is_in_the_hand_does_not_lie_anywhere(setup: ResolvedConfig, tmp_path: Path) -> None:
    path = tmp_path / "world.yaml"
    path.write_text(
        "scene: kitchen_furnished\nbeliefs:\n  hands: {arm: {name: mug, what: {model: mug}, width: 5 cm,"
        " tool_from_object: {position: [0, 0, 2 cm]}}}\n  objects:\n"
        "    mug: {what: {model: mug}, surface: table/top, pose: {position: [3.1, -0.2, 80 cm]}}\n"
    )
    with pytest.raises(
        ConfigurationError, match="mug is also held by the hand; remove one of the two entries"
    ) as refused:
        read_world(path).world_model(setup)
    assert refused.value.problems[0].line == 5
