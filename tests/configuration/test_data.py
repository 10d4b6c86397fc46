"""Shipped data is found by name, whatever the working directory: in the checkout and in an installed wheel."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_names, data_root, find_data
from bestman_bt.configuration.errors import ConfigurationError

ROOT = Path(__file__).parents[2]


def test_the_checkout_comes_first() -> None:
    assert data_root() == ROOT


def test_a_bare_name_is_found_from_any_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "kitchen.yaml").write_text("{}")
    monkeypatch.chdir(tmp_path)
    assert find_data("scene", "kitchen") == ROOT / "assets/scenes/kitchen.yaml"


def test_a_path_means_that_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "kitchen.yaml"
    path.write_text("{}")
    monkeypatch.chdir(tmp_path)
    assert find_data("scene", path) == path
    assert find_data("scene", "kitchen.yaml").resolve() == path
    assert find_data("scene", "./kitchen.yaml").resolve() == path


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("robot", "dif_panda", "unknown robot 'dif_panda'; did you mean 'diff_panda'?"),
        ("task", "fetch_cop", "unknown task 'fetch_cop'; did you mean 'fetch_cup'?"),
        ("scene", "kichen", "unknown scene 'kichen'; did you mean 'kitchen'?"),
        ("part", "panda_arn", "unknown part 'panda_arn'; did you mean 'panda_arm'?"),
        ("tree", "nowhere/tree.xml", "nowhere/tree.xml: no such tree file"),
        ("scene", "", "unknown scene ''"),
        ("scene", "../robots/column", "no such scene file"),
        (
            "robot",
            "omni_base+iiwa_rm+wsg50",
            "omni_base+iiwa_rm+wsg50: unknown part 'iiwa_rm'; did you mean 'iiwa_arm'?",
        ),
        ("robot", "omni_base+iiwa_arm+wsg50", "has no cameras, lidar and postures yet: write a robot file"),
    ],
)
def test_an_unknown_name_suggests_the_closest(kind: str, name: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        find_data(kind, name)
    assert message in str(error.value)


def test_the_shipped_names_are_listed() -> None:
    assert "diff_panda" in data_names("robot")
    assert {"kitchen", "kitchen_without_cup", "kitchen_covered_counter"} <= set(data_names("scene"))


def test_an_installed_package_finds_its_own_data(tmp_path: Path) -> None:
    package = tmp_path / "site-packages" / "bestman_bt"
    for name in ("configuration", "messages"):
        shutil.copytree(ROOT / "bestman_bt" / name, package / name)
    for name in ("__init__.py", "errors.py", "extras.py", "registry.py"):
        shutil.copy(ROOT / "bestman_bt" / name, package / name)
    for folder in ("assets", "configs"):
        shutil.copytree(ROOT / folder, package / "_data" / folder)
    code = "from bestman_bt.configuration import data, task; print(data.find_data('scene', 'kitchen'))"
    run = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={"PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(run.stdout.strip()) == package / "_data/assets/scenes/kitchen.yaml"
