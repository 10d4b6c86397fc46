"""bestman-bt map: what a map file holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bestman_bt.messages import OccupancyGrid
from bestman_bt.navigation.map_file import write_map
from tests.cli.command_line import Answer

pytestmark = pytest.mark.slow

Command = Callable[..., Answer]


def test_a_map_is_reported_and_drawn(bestman_bt: Command, folder: Path) -> None:
    data = np.zeros((40, 80), dtype=np.int8)
    data[:, :20], data[:, 40] = -1, 100
    write_map(OccupancyGrid(data, 0.05, np.array([-1.0, 0.5])), folder / "hall.yaml")
    answer = bestman_bt("map", "show", "hall.yaml", "--png", "hall.png", "--json")
    assert answer.code == 0, answer.err
    facts = answer.document
    assert facts["cells"] == [40, 80]
    assert facts["unknown_m2"] == pytest.approx(2.0)
    assert facts["occupied_m2"] == pytest.approx(0.1)
    assert facts["free_m2"] == pytest.approx(5.9)
    pixels = np.asarray(Image.open(folder / "hall.png").convert("RGB")).reshape(-1, 3)
    assert {(0, 0, 0), (255, 255, 255)} <= set(map(tuple, pixels.tolist()))


def test_a_picture_shows_what_is_known_of_a_map_that_is_mostly_unknown(bestman_bt: Command, folder: Path) -> None:
    data = np.full((400, 400), -1, dtype=np.int8)
    data[200:240, 200:280] = 0
    for name, known in (("small", data), ("nothing", np.full((400, 400), -1, dtype=np.int8))):
        write_map(OccupancyGrid(known, 0.05, np.array([-10.0, -10.0])), folder / f"{name}.yaml")
        assert bestman_bt("map", "show", f"{name}.yaml", "--png", f"{name}.png").code == 0
    pixels = np.asarray(Image.open(folder / "small.png").convert("RGB"))
    floor = pixels[pixels.shape[0] // 4 : -pixels.shape[0] // 4, pixels.shape[1] // 4 : -pixels.shape[1] // 4] == 255
    assert floor.all()


@pytest.mark.parametrize(("text", "words"), [(None, "no such file"), ("image: gone.pgm\n", "resolution")])
def test_a_wrong_map_is_wrong_input(bestman_bt: Command, folder: Path, text: str | None, words: str) -> None:
    if text is not None:
        (folder / "hall.yaml").write_text(text)
    answer = bestman_bt("map", "show", "hall.yaml")
    assert answer.code == 2
    assert words in answer.err
    assert "hall.yaml" in answer.err


@pytest.mark.parametrize(
    ("png", "words"), [("nowhere/a.png", "does not exist"), ("hall.foo", "FILE.png"), (".", "FILE.png")]
)
def test_a_picture_that_cannot_be_written_is_wrong_input(
    bestman_bt: Command, folder: Path, png: str, words: str
) -> None:
    write_map(OccupancyGrid(np.zeros((4, 4), dtype=np.int8), 0.05, np.zeros(2)), folder / "hall.yaml")
    answer = bestman_bt("map", "show", "hall.yaml", "--png", png)
    assert answer.code == 2
    assert words in answer.err
