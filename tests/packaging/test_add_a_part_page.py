"""The files of the page "Add a part" do what it says, as they are written there."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.cli.main import main
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import load_tree
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.registry import CONNECTIONS, PARTS, SIMULATED_SENSORS, undone
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import session
from bestman_bt.runtime.tree_checks import lacking_parts

PAGE = (Path(__file__).parents[2] / "docs" / "add_a_part.md").read_text()
BLOCKS = re.findall(r"^```(?:python|yaml|xml)\n((?:#|<!--) ([\w.]+)(?: -->)?\n.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
FILES = {name: text for text, name in BLOCKS}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The page's files in a folder, which is the present one; what they register is forgotten afterwards."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    with undone(PARTS, SIMULATED_SENSORS, CONNECTIONS):
        yield tmp_path


def script(name: str) -> str:
    """What a script of the page prints."""
    ran = subprocess.run([sys.executable, name], capture_output=True, text=True, timeout=60)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_a_sensor_takes_four_files_and_a_vendor_three() -> None:
    assert sorted(FILES) == [
        *("acme.py", "acme_robot.yaml", "is_it_warm.xml", "show_limits.py"),
        *("thermometer.py", "thermometer.yaml", "try_acme.py", "warm_robot.yaml"),
    ]


@pytest.mark.slow
def test_limits_are_read_where_the_page_says(folder: Path) -> None:
    assert script("show_limits.py").startswith("base: 0.6 m/s; ")


def test_a_skill_reads_the_sensor_in_simulation_and_fails_where_it_is_too_warm(folder: Path) -> None:
    with session("warm_robot.yaml", "kitchen", seed=3, plugins=["thermometer.py"]) as opened:
        execution = opened.run("is_it_warm.xml")
        assert execution.succeeded
        height = ForwardKinematics(opened.skills.robot).pose("thermometer_link", {}).position[2]
        warm = opened.skills.sensors["thermometer"].read()
        assert warm == pytest.approx(20.0 + 3.0 * height, abs=0.3)
        limit = f'most="{warm - 1.0}"'
        execution = opened.run((folder / "is_it_warm.xml").read_text().replace('most="30"', limit))
        assert not execution.succeeded
        assert [failure.error_code for failure in opened.skills.failures] == ["too_warm"]
        assert opened.robot.audit_record().truth_reads == 0


@pytest.mark.parametrize("verb", ["show", pytest.param("check", marks=pytest.mark.slow)])
def test_a_robot_of_a_part_that_a_plug_in_brings_is_shown_and_checked(
    folder: Path, verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["bestman-bt", "robot", verb, "warm_robot.yaml", "--plugin", "thermometer.py"])
    with pytest.raises(SystemExit) as end:
        main()
    assert (end.value.code, "warm_robot" in capsys.readouterr().out) == (0, True)


def test_a_robot_without_the_sensor_refuses_the_tree(folder: Path) -> None:
    tree, turtle = load_tree("is_it_warm.xml", node_registry(["thermometer.py"])), load_robot_model("turtle")
    (problem,) = lacking_parts(tree, turtle, turtle.parts)
    assert f"\n{problem}\n" in PAGE
    warm = load_robot_model("warm_robot.yaml")
    assert not lacking_parts(tree, warm, warm.parts)


def test_a_mistake_in_the_new_kind_is_reported_with_file_line_and_field(folder: Path) -> None:
    text = FILES["thermometer.yaml"].replace("10 Hz", "-1 Hz")
    (folder / "thermometer.yaml").write_text(text)
    config = load_run(None, scene="kitchen", robot="warm_robot.yaml", seed=1, plugins=["thermometer.py"])
    with pytest.raises(ConfigurationError, match=r"thermometer.yaml:6: rate: should be greater than 0, got '-1 Hz'"):
        prepare(config)


def test_a_kind_that_nobody_has_registered_is_refused_with_those_there_are(folder: Path) -> None:
    with pytest.raises(ConfigurationError, match="unknown kind 'thermometer'; "):
        load_robot_model("warm_robot.yaml")


@pytest.mark.slow
def test_the_law_holds_for_a_gripper_of_a_vendor_that_a_plug_in_brings(folder: Path) -> None:
    assert script("try_acme.py") == "succeeded True 40 mm\n"
