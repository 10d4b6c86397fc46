"""The computer of a robot: the wheel and its vendors' extras in a fresh environment are small, and run the robot."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
LARGEST = 900_000_000
"""Bytes of all files, without what describes the robot."""
ADDRESSES = (
    *("--set", "robot.connections.arm_controller.address=127.0.0.1:1"),
    *("--set", "robot.connections.platform.address=127.0.0.1:2"),
)


@pytest.fixture(scope="module")
def packages() -> dict[str, str]:
    """The environment in which uv finds packages where this user's pip does."""
    specification = importlib.util.spec_from_file_location("install", CHECKOUT / "scripts" / "install.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(CHECKOUT / "scripts"))
        specification.loader.exec_module(module)
    listing = [sys.executable, "-m", "pip", "config", "list"]
    listed = subprocess.run(listing, capture_output=True, text=True, check=True).stdout
    return {**os.environ, **module.uv_settings(listed, dict(os.environ))}


@pytest.fixture(scope="module")
def robot_computer(packages: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheel and the extras of both controllers of an xArm on its base."""
    folder = tmp_path_factory.mktemp("robot")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(CHECKOUT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    environment = folder / "environment"
    for command in (
        [BIN / "uv", "venv", "--quiet", "--python", sys.executable, environment],
        [BIN / "uv", "pip", "install", "--python", environment / "bin/python", f"{wheel}[xarm,rosbridge]"],
    ):
        done = subprocess.run(command, env=packages, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return environment


def bestman_bt(environment: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command as installed there, in a folder and with user data of its own; descriptions are there."""
    models = find_spec("pybullet_data")
    assert models is not None
    assert models.submodule_search_locations
    data = folder / "data" / "bestman-bt"
    data.mkdir(parents=True)
    (data / "pybullet_data").symlink_to(models.submodule_search_locations[0])
    settings = {**os.environ, "XDG_DATA_HOME": str(data.parent)}
    settings.pop("PYTHONPATH", None)
    command = [str(environment / "bin" / "bestman-bt"), *arguments]
    return subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, check=False)


def test_it_is_small_and_has_no_simulator(robot_computer: Path) -> None:
    files = [Path(folder) / name for folder, _, names in os.walk(robot_computer) for name in names]
    assert sum(file.lstat().st_size for file in files) <= LARGEST
    installed = {file.parent.name.partition("-")[0] for file in files if file.name == "METADATA"}
    assert {"bestman_bt", "numpy", "xarm_python_sdk"} <= installed
    assert not installed & {"pybullet", "rerun_sdk", "coacd", "example_robot_data", "open3d", "open3d_cpu"}


@pytest.mark.parametrize("arguments", ["version", "show fetch_cup"])
def test_commands_that_start_no_robot_work(robot_computer: Path, tmp_path: Path, arguments: str) -> None:
    done = bestman_bt(robot_computer, tmp_path, *arguments.split())
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_a_simulated_run_names_the_extra_that_it_needs(robot_computer: Path, tmp_path: Path) -> None:
    done = bestman_bt(robot_computer, tmp_path, "run", "fetch_cup")
    assert done.returncode == 2
    assert "needs the package 'pybullet': pip install 'bestman-bt[sim] @ file:///" in done.stderr
    assert ".whl'" in done.stderr


def test_a_robot_is_loaded_and_its_controllers_are_asked(robot_computer: Path, tmp_path: Path) -> None:
    run = ("run", "pick_place_table", "--robot", "diff_xarm6", "--driver", "hardware", *ADDRESSES)
    done = bestman_bt(robot_computer, tmp_path, *run)
    assert done.returncode == 2
    assert "nothing was started: arm_controller: no xArm controller answers at its address" in done.stderr


def test_the_command_that_a_message_names_brings_the_extra(robot_computer: Path, packages: dict[str, str]) -> None:
    asked = [BIN / "uv", "pip", "install", "--dry-run", "--python", robot_computer / "bin/python", "bestman-bt[sim]"]
    done = subprocess.run(asked, env=packages, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert " + pybullet==" in done.stderr
    assert "bestman-bt" not in done.stderr.replace("bestman-bt[sim]", "")
