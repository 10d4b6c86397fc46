"""Robots are described without PyBullet: its models are unpacked alone, and every shipped robot loads from them."""

from __future__ import annotations

import re
import shutil
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_names, data_root, pybullet_data
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.extras import PYBULLET_HAS_WHEELS, missing_extra
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime import robot_facts
from bestman_bt.runtime.robot_facts import REQUIREMENT, SHA256, bring_pybullet_data, find_robot
from bestman_bt.scene.object_file import read_object

ASSETS = data_root() / "assets"
LOCK = Path(__file__).resolve().parents[2] / "requirements.lock"


def installed_models() -> Path:
    specification = find_spec("pybullet_data")
    if specification is None:
        raise missing_extra("the comparison with its models", "sim")
    assert specification.submodule_search_locations
    return Path(specification.submodule_search_locations[0])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel that holds what PyBullet's does of the models that shipped robots and objects name, and its library."""
    texts = [path.read_text() for path in ASSETS.rglob("*.yaml")]
    named = {name for text in texts for name in re.findall(r"pybullet_data[:/]([\w.]+)", text)}
    models = installed_models()
    file = tmp_path_factory.mktemp("wheels") / "pybullet-3.2.7-cp311-cp311-manylinux2014_x86_64.whl"
    with zipfile.ZipFile(file, "w") as opened:
        opened.writestr("pybullet.cpython-311-x86_64-linux-gnu.so", b"the simulator")
        for path in sorted(path for name in named for path in [models / name, *(models / name).rglob("*")]):
            if path.is_file():
                opened.write(path, f"pybullet_data/{path.relative_to(models)}")
    return file


@pytest.fixture
def no_pybullet(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """As where PyBullet is not installed; the folder in which the user's data lie."""
    for name in ("pybullet", "pybullet_data"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(ImportError):
        import pybullet  # noqa: F401
    return tmp_path / "bestman-bt"


def test_the_models_alone_are_unpacked(no_pybullet: Path, wheel: Path) -> None:
    assert pybullet_data() is None
    folder = bring_pybullet_data(wheel)
    assert [path.name for path in no_pybullet.iterdir()] == ["pybullet_data"]
    assert pybullet_data() == folder == no_pybullet / "pybullet_data"
    panda = Path("franka_panda/panda.urdf")
    assert (folder / panda).read_bytes() == (installed_models_of(wheel) / panda).read_bytes()


def installed_models_of(wheel: Path) -> Path:
    folder = wheel.parent / "reference"
    if not folder.exists():
        shutil.unpack_archive(wheel, folder, "zip")
    return folder / "pybullet_data"


@pytest.fixture(scope="module")
def unpacked(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of user data with the models in it."""
    folder = tmp_path_factory.mktemp("data")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_DATA_HOME", str(folder))
        bring_pybullet_data(wheel)
    return folder


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("name", data_names("robot"))
def test_every_shipped_robot_loads_without_pybullet_as_with_it(
    name: str, no_pybullet: Path, unpacked: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(unpacked))
    without = load_robot_model(name).urdf
    monkeypatch.undo()
    with_pybullet = load_robot_model(name).urdf
    assert str(installed_models()) not in without
    alone = str(unpacked / "bestman-bt" / "pybullet_data")
    assert without.replace(alone, "MODELS") == with_pybullet.replace(str(installed_models()), "MODELS")


@pytest.mark.parametrize("hand", ["xarm_gripper", "wsg50", "pr2_gripper", "panda_hand"])
@pytest.mark.parametrize("arm", ["panda_arm", "xarm6_arm", "iiwa_arm"])
def test_every_part_of_pybullets_models_is_described_without_it(
    arm: str, hand: str, no_pybullet: Path, unpacked: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(unpacked))
    assert find_robot(f"husky_base+{arm}+{hand}").of(ArmModel)


def test_an_object_of_pybullets_models_is_described_without_it(
    no_pybullet: Path, unpacked: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(unpacked))
    assert read_object(ASSETS / "objects" / "duck.yaml").collision


def test_what_is_missing_is_said_with_the_commands_that_bring_it(no_pybullet: Path) -> None:
    commands = "bestman-bt robot descriptions" + (r".*pip install .*\[sim\]'" if PYBULLET_HAS_WHEELS else "")
    with pytest.raises(ConfigurationError, match=rf"panda_arm.yaml:\d+: urdf: franka_panda/panda.urdf .*{commands}"):
        load_robot_model("diff_panda")
    with pytest.raises(
        ConfigurationError, match=rf"wsg50.yaml:\d+: dimensions.*gripper/meshes/WSG50_110.stl .*{commands}"
    ):
        find_robot("omni_base+ur5_arm+wsg50")
    with pytest.raises(ConfigurationError, match=rf"duck.yaml.*duck_vhacd.obj .*{commands}"):
        read_object(ASSETS / "objects" / "duck.yaml")


def test_a_wheel_of_something_else_leaves_nothing(no_pybullet: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.whl"
    with zipfile.ZipFile(other, "w") as opened:
        opened.writestr("other/__init__.py", "")
    for wheel, words in ((other, "does not contain pybullet_data"), (tmp_path / "none.whl", "cannot be read")):
        with pytest.raises(ConfigurationError, match=words):
            bring_pybullet_data(wheel)
        assert not list(no_pybullet.iterdir())


@pytest.mark.slow
def test_a_download_that_fails_reports_why_and_leaves_nothing(
    no_pybullet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_facts, "SHA256", "0" * 64)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(ConfigurationError, match=r"pip install .* failed: .*"):
        bring_pybullet_data()
    assert not list(no_pybullet.iterdir())


def test_the_download_is_the_locked_release() -> None:
    entry = re.search(rf"^{re.escape(REQUIREMENT)} .*?(?=^[a-z])", LOCK.read_text(), re.MULTILINE | re.DOTALL)
    assert entry is not None, "the lock has another release of PyBullet: give robot_facts.py that and its hash"
    assert f"sha256:{SHA256}" in entry.group()
