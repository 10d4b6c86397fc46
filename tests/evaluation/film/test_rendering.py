from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bestman_bt.evaluation.film import rendering
from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.film.rendering import RenderOptions, blender_job, render, viewpoint
from bestman_bt.scene.scene import Wall
from bestman_bt.visualization.blender.painting import BlenderError


@pytest.fixture
def few_sides(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two sides and two moments to choose from: the choice costs a picture for each."""
    monkeypatch.setattr(rendering, "AZIMUTHS", np.array([0.0, math.pi]))
    monkeypatch.setattr(rendering, "ELEVATIONS", (math.radians(40.0),))
    monkeypatch.setattr(rendering, "KEY_MOMENTS", 2)


@pytest.mark.usefixtures("few_sides")
def test_a_run_becomes_a_still_and_a_film(run: FilmedRun, tmp_path: Path) -> None:
    told: list[str] = []

    written = render(run, tmp_path / "out", RenderOptions(at=(0.53,), film=True, size=(160, 120)), told.append)

    still, film = written
    assert still.name == "still-000.53.jpg"
    assert Image.open(still).size == (160, 120)
    assert np.asarray(Image.open(still)).std() > 10.0
    assert film.read_bytes()[4:8] == b"ftyp"
    assert told[-1] == "picture 13 of 13"  # the still, and a second that is as long as it was


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (RenderOptions(at=(99.0,)), "no second 99: it goes from 0 to 1.00"),
        (RenderOptions(at=(math.nan,)), "no second nan"),
        (RenderOptions(size=(961, 720)), "two even numbers from 64 to 4096"),
        (RenderOptions(size=(9600, 720)), "two even numbers from 64 to 4096"),
    ],
)
def test_what_cannot_be_rendered_is_refused(run: FilmedRun, tmp_path: Path, options: RenderOptions, words: str) -> None:
    with pytest.raises(FilmError, match=words):
        render(run, tmp_path / "out", options, lambda _: None)

    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_reported_before_anything_is_drawn(run: FilmedRun, tmp_path: Path) -> None:
    (tmp_path / "file").touch()

    with pytest.raises(FilmError, match="cannot be written: Not a directory"):
        render(run, tmp_path / "file" / "out", RenderOptions(), lambda what: pytest.fail(what))


def test_without_blender_the_error_says_the_one_command(
    run: FilmedRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("BESTMAN_BT_BLENDER_PYTHON", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))

    with pytest.raises(BlenderError, match="bestman-bt render --install-blender"):
        render(run, tmp_path / "out", RenderOptions(blender=True), lambda _: None)


def test_walls_between_camera_and_subject_are_left_out_and_others_stay(run: FilmedRun, tmp_path: Path) -> None:
    west = next(i for i, wall in enumerate(run.world.walls) if _is_west(wall, run.world.walls))
    wall = run.world.walls[west]
    x, y = (np.array(wall.start) + np.array(wall.end)) / 2.0
    inside, outward = np.array([x + 1.0, y, 0.7]), math.pi
    snapshot = run.motion.at(0.0)

    def hidden(azimuth: float) -> frozenset[str]:
        view = viewpoint(inside, azimuth, 0.5)
        return blender_job(run, [(snapshot, view)], [tmp_path / "a.png"], (64, 64), 1).hidden

    assert f"wall{west}" in hidden(outward)
    assert f"wall{west}" not in hidden(outward + math.pi)


def test_blender_is_told_of_all_bodies_and_links_in_each_frame(run: FilmedRun, tmp_path: Path) -> None:
    snapshot = run.motion.at(0.0)
    view = viewpoint(np.array([0.0, 0.0, 0.7]), 0.3, 0.5)

    document = blender_job(run, [(snapshot, view)], [tmp_path / "a.png"], (64, 48), 1).document()

    (frame,) = document["frames"]
    finishes = {body["name"]: body["finish"] for body in document["bodies"]}
    assert finishes["cup"] == "object"
    assert finishes["fridge"] == finishes["fridge/upper_door"] == "furniture"
    assert set(frame["bodies"]) <= set(finishes)
    assert set(frame["links"]) == {link["name"] for link in document["robot"]}
    assert frame["bodies"]["cup"][:3] == pytest.approx(snapshot.body_poses["cup"].position)


def _is_west(wall: Wall, walls: tuple[Wall, ...]) -> bool:
    least = min(x for other in walls for x, _ in (other.start, other.end))
    return wall.start[0] == wall.end[0] == least
