"""The fingerprint of a configuration covers what its files name, and paths count from the file that names them."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration import data_root, load_run
from bestman_bt.evaluation.code_version import config_fingerprint
from bestman_bt.scene import load_scene


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A variant of a shipped scene with a piece of furniture of the user's own beside it."""
    (tmp_path / "stiff.yaml").write_text((data_root() / "assets/furniture/table.yaml").read_text())
    path = tmp_path / "mine.yaml"
    path.write_text("extends: kitchen\nfurniture:\n  table: {model: stiff.yaml}\n")
    return path


def test_furniture_that_a_scene_names_is_part_of_the_fingerprint(scene: Path) -> None:
    config = load_run("fetch_cup", scene=scene)
    before = config_fingerprint(config)
    assert config_fingerprint(config) == before
    with (scene.parent / "stiff.yaml").open("a") as file:
        file.write("\nfriction: 0.1\n")
    assert config_fingerprint(config) != before


def test_a_scene_finds_furniture_beside_its_file(scene: Path) -> None:
    assert load_scene(scene).furniture["table"].name == "stiff"
