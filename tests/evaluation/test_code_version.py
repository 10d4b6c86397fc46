"""The fingerprint of a configuration covers what its files name, and paths count from the file that names them."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_root
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.code_version import config_fingerprint
from bestman_bt.scene.load import load_scene


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


@pytest.mark.parametrize("kind", ["xml", "py"])
@pytest.mark.parametrize("changed", ["policies.py", "gains.py", "shapes/round.py"])
def test_python_files_that_a_tree_names_and_what_they_import_are_part_of_the_fingerprint(
    tmp_path: Path, kind: str, changed: str
) -> None:
    (tmp_path / "shapes").mkdir()
    (tmp_path / "policies.py").write_text("from shapes import round\n\nimport gains\n\n\nclass Mine: ...\n")
    (tmp_path / "gains.py").write_text("P = 1.0\n")
    (tmp_path / "shapes" / "round.py").write_text("RADIUS = 0.1\n")
    tree = tmp_path / f"mine.{kind}"
    if kind == "xml":
        leaf = '<RunPolicy policy="policies.py:Mine"/>'
        tree.write_text(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{leaf}</BehaviorTree></root>')
    else:
        tree.write_text('def build():\n    return RunPolicy(policy="policies.py:Mine")\n')
    config = load_run("fetch_cup", tree=tree)
    before = config_fingerprint(config)
    assert config_fingerprint(config) == before
    with (tmp_path / changed).open("a") as file:
        file.write("# changed\n")
    assert config_fingerprint(config) != before
