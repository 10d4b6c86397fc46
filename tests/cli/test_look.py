"""``bestman-bt look``: pictures, a recording and a document of what the robot perceives."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from bestman_bt.cli.main import main
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.simulation.robot import SimulatedRobot
from tests.cli.command_line import Answer, files_in

Command = Callable[..., Answer]

COUNTER = """
description: A microwave and a can on a counter.
walls:
  height: 1.1 m
  thickness: 10 cm
  lines: [[[-2, -2], [2.5, -2]], [[2.5, -2], [2.5, 2]], [[2.5, 2], [-2, 2]], [[-2, 2], [-2, -2]]]
furniture:
  counter: {model: counter, at: [1.4, 0, 0]}
  microwave: {model: microwave, on: counter/top, at: [7 cm, -52 cm, 0], offset: 1 cm}
objects:
  can: {model: can, surface: counter/top, at: [-10 cm, 20 cm, 0]}
robot_start: {x: [-0.6, 0.1], y: [-0.4, 0.4]}
"""


@dataclass(frozen=True)
class Looked:
    """What ``look --json`` printed and left."""

    answer: Answer
    folder: Path

    @property
    def look(self) -> dict[str, Any]:
        (look,) = self.answer.document["looks"]
        return dict(look)


@pytest.fixture(scope="module")
def looked(tmp_path_factory: pytest.TempPathFactory) -> Looked:
    """One look at the counter, for all tests that read what it left."""
    folder = tmp_path_factory.mktemp("look")
    (folder / "counter.yaml").write_text(COUNTER)
    out, err = io.StringIO(), io.StringIO()
    words = ["look", "--scene", "counter.yaml", "--seed", "2", "--at", "counter", "--save", "seen/here", "--json"]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["bestman-bt", *words])
        with pytest.raises(SystemExit) as end:
            main()
    assert isinstance(end.value.code, int)
    return Looked(Answer(end.value.code, out.getvalue(), err.getvalue()), folder)


@pytest.fixture
def refused(bestman_bt: Command, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """A look that must be refused before anything is started or written; returns the message."""
    started: list[object] = []
    monkeypatch.setattr(SimulatedRobot, "connect", started.append)

    def refuse(*arguments: object) -> str:
        files = files_in(folder)
        answer = bestman_bt("look", *arguments)
        assert (answer.code, answer.out, started) == (2, "", [])
        assert files_in(folder) == files
        assert "Traceback" not in answer.err
        return answer.err

    return refuse


def test_the_document_reports_what_stands_where_with_its_uncertainty(looked: Looked) -> None:
    assert looked.answer.code == 0
    assert looked.answer.document["seed"] == 2
    look = looked.look
    assert look["furniture"] == "counter"
    (can,) = look["objects"]
    truth = draw_world(load_scene(looked.folder / "counter.yaml"), 2).objects[0].pose
    assert can["name"] == "can"
    assert can["recognised"]
    assert np.linalg.norm(np.subtract(can["position"], truth.position)) < 0.02  # also the base is not where it was told
    assert 0.5 < can["confidence"] <= 1.0
    assert 0.0 < can["position_std"] < 0.01
    assert can["yaw_set"] == []
    (handle,) = look["handles"]
    assert (handle["name"], handle["kind"]) == ("microwave/handle_1", "bar")
    assert np.linalg.norm(handle["axis"]) == pytest.approx(1.0, abs=1e-3)
    assert 0.003 < handle["radius"] < 0.012
    assert 0.5 <= handle["joint_confidence"] <= 1.0
    assert np.dot(handle["axis"], handle["opening_direction"]) == pytest.approx(0.0, abs=0.05)


def test_the_document_reports_the_best_grasp_of_each_thing_and_the_surfaces(looked: Looked) -> None:
    grasps = {grasp["target"]: grasp for grasp in looked.look["grasps"]}
    assert set(grasps) == {"can", "microwave/handle_1"}
    assert 0.0 < grasps["can"]["width"] < 0.08
    (can,) = looked.look["objects"]
    assert np.linalg.norm(np.subtract(grasps["can"]["position"], can["position"])) < 0.1
    assert np.linalg.norm(grasps["can"]["quaternion"]) == pytest.approx(1.0, abs=1e-3)
    (surface,) = looked.look["surfaces"]
    assert surface["name"] == "counter/top"
    assert surface["height"] == pytest.approx(0.9, abs=0.01)
    assert min(surface["size"]) > 0.4


def test_what_was_not_found_is_among_the_failures(looked: Looked) -> None:
    (failure,) = looked.look["failures"]
    assert failure["code"] == "handle_not_found"
    assert failure["why"].startswith("no handle on the counter: 1 handle")


def test_each_view_leaves_a_picture_and_all_together_a_recording(looked: Looked) -> None:
    files = [looked.folder / name for name in looked.look["files"]]
    assert [file.name for file in files] == ["counter_0.png", "counter_1.png", "counter.rrd"]
    assert all(file.parent == looked.folder / "seen" / "here" for file in files)
    for file in files[:2]:
        with Image.open(file) as picture:
            assert picture.size == (1280, 960)
            assert np.asarray(picture).std() > 20.0


def test_the_recording_holds_images_clouds_and_marks(looked: Looked) -> None:
    from rerun.chunk import RrdReader

    entities = {chunk.entity_path for chunk in RrdReader(looked.folder / "seen" / "here" / "counter.rrd").stream()}
    for entity in (
        "/world/camera/head_camera_0/rgb",
        "/world/camera/head_camera_1/depth",
        "/world/scene/objects/can/box",
        "/world/scene/objects/can/points",
    ):
        assert entity in entities
    for start in (
        "/world/scene/handles/microwave",
        "/world/scene/surfaces/counter",
        "/world/scene/grasps/can",
        "/world/sensed/head_camera_0",
    ):
        assert any(entity.startswith(start) for entity in entities), start


def test_the_folder_holds_nothing_but_what_the_document_lists(looked: Looked) -> None:
    left = {str(file.relative_to(looked.folder)) for file in looked.folder.rglob("*") if file.is_file()}
    assert left == {"counter.yaml", *looked.look["files"]}
    assert json.loads(looked.answer.out) == looked.answer.document


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--at", "tabel"], "--at: the map has no furniture 'tabel'; did you mean 'table'?"),
        (["--scene", "kichen"], "unknown scene 'kichen'; did you mean 'kitchen'?"),
        (["--robot", "dif_panda"], "unknown robot 'dif_panda'; did you mean 'diff_panda'?"),
        (["--set", "scene.finger_frction=3"], "unknown key 'finger_frction'; did you mean 'finger_friction'?"),
        (["--set", "robot.parts.arm.part=panda_amr"], "unknown part 'panda_amr'; did you mean 'panda_arm'?"),
        (["--views", "0"], "'--views'"),
        (["--seed", "-1"], "'--seed'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_wrong_names_and_options_are_refused(refused, arguments: list[str], message: str) -> None:
    assert message in refused(*arguments)


@pytest.mark.parametrize("path", ["taken", "taken/inside"])
def test_a_file_where_the_folder_should_be_is_refused(refused, folder: Path, path: str) -> None:
    (folder / "taken").write_text("a file")
    assert f"--save: {path} cannot be created as a folder: " in refused("--at", "table", "--save", path)
    assert (folder / "taken").read_text() == "a file"


@pytest.fixture
def towards_the_wall(folder: Path) -> str:
    """A scene whose counter has its front 25 cm before a wall."""
    (folder / "turned.yaml").write_text(COUNTER.replace("at: [1.4, 0, 0]", "at: [1.9, 0, 180 deg]"))
    return "turned.yaml"


def test_furniture_that_is_asked_for_and_has_no_room_before_it_is_refused(refused, towards_the_wall: str) -> None:
    told = refused("--scene", towards_the_wall, "--at", "counter")
    assert "no room for the robot in front of the counter" in told


def test_without_being_asked_for_it_is_left_out_and_reported(bestman_bt: Command, towards_the_wall: str) -> None:
    answer = bestman_bt("look", "--scene", towards_the_wall, "--json")
    assert answer.code == 0
    looks = answer.document["looks"]
    assert [(look["furniture"], look["failures"][0]["code"], look["files"]) for look in looks] == [
        ("counter", "no_room", []),
        ("microwave", "no_room", []),
    ]
