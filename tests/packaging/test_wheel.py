"""The wheel carries the three packages, the data they find by name, and nothing else."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PACKAGES = ("bestman_bt", "behaviours", "hal")
DATA_FOLDERS = ("assets", "configs", "trees")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(CHECKOUT)]
    subprocess.run(build, check=True, capture_output=True)
    (file,) = folder.glob("*.whl")
    return zipfile.ZipFile(file)


def files_below(folder: str) -> set[str]:
    paths = (CHECKOUT / folder).rglob("*")
    return {str(path.relative_to(CHECKOUT)) for path in paths if path.is_file() and "__pycache__" not in path.parts}


def test_every_module_is_in_the_wheel(wheel: zipfile.ZipFile) -> None:
    modules = {name for package in PACKAGES for name in files_below(package) if name.endswith((".py", "py.typed"))}
    assert modules >= {f"{package}/py.typed" for package in PACKAGES}
    assert modules <= set(wheel.namelist())


@pytest.mark.parametrize("folder", DATA_FOLDERS)
def test_every_data_file_travels_below_the_package(wheel: zipfile.ZipFile, folder: str) -> None:
    expected = {f"bestman_bt/_data/{name}" for name in files_below(folder)}
    assert expected, f"{folder}/ is empty"
    assert expected <= set(wheel.namelist())


def test_nothing_but_packages_and_metadata_is_installed(wheel: zipfile.ZipFile) -> None:
    tops = {name.split("/")[0] for name in wheel.namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)


def test_the_command_points_at_a_function_in_the_wheel(wheel: zipfile.ZipFile) -> None:
    (entry_points,) = (name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt"))
    parser = configparser.ConfigParser()
    parser.read_string(wheel.read(entry_points).decode())
    module, _, function = parser["console_scripts"]["bestman-bt"].partition(":")
    source = wheel.read(f"{module.replace('.', '/')}.py").decode()
    assert f"def {function}(" in source or f"{function} =" in source


def test_no_machine_learning_framework_is_required(wheel: zipfile.ZipFile) -> None:
    (metadata,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    required = [line for line in wheel.read(metadata).decode().splitlines() if line.startswith("Requires-Dist:")]
    assert required
    assert not [line for line in required if any(name in line for name in ("torch", "tensorflow", "jax", "nvidia"))]


@pytest.mark.slow
def test_a_third_party_tests_its_driver_with_the_suite_in_the_wheel(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    installed, own = tmp_path / "installed", tmp_path / "own"
    wheel.extractall(installed)
    shutil.copytree(CHECKOUT / "examples" / "driver_in_memory", own)
    options = ["--pyargs", "hal.conformance", "--driver", "memory_robot:MemoryRobot", "-v", "-p", "no:cacheprovider"]
    options += ["--rootdir", str(tmp_path)]  # so that the report tells whose file it runs
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [Path(sys.executable).parent / "pytest", *options], cwd=own, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "installed/hal/conformance/test_driver.py" in done.stdout
    assert " failed" not in done.stdout
