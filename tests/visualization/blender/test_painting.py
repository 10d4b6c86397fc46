from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import bestman_bt
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.visualization.blender import painting
from bestman_bt.visualization.blender.painting import (
    SCRIPT,
    BlenderBody,
    BlenderError,
    BlenderFrame,
    BlenderJob,
    BlenderRobot,
    blender_python,
    install_blender,
    paint,
)
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot

StandIn = Callable[[str], Path]
URDF = """
<robot name="post">
  <link name="base"><visual><origin xyz="0 0 0.2"/><geometry><box size="0.1 0.1 0.4"/></geometry>
    <material name="m"><color rgba="0.1 0.1 0.9 1"/></material></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <link name="arm"><visual><origin xyz="0.2 0 0"/>
    <geometry><cylinder radius="0.02" length="0.4"/></geometry></visual></link>
</robot>
"""
STAND_IN = """#!{python}
import json, os, sys
assert sys.argv[1] == "-I" and sys.argv[2].endswith("paint_scene.py"), sys.argv
assert not [key for key in os.environ if key.startswith("PYTHON")]
from PIL import Image
job = json.load(open(sys.argv[3]))
{body}
"""
PAINTS = """
print("Blender says this and that")
for frame in job["frames"]:
    Image.new("RGB", (job["width"], job["height"])).save(frame["file"])
    print("bestman-bt: painted " + frame["file"], flush=True)
"""


def _job(folder: Path, count: int = 2, size: tuple[int, int] = (64, 48)) -> BlenderJob:
    red = RecordedBody("cube", (PlacedShape(Box((0.3, 0.3, 0.3)), Pose()),), ((0.9, 0.05, 0.05, 1.0),), Pose())
    cube = {"cube": Pose(np.array([1.0, 0.0, 0.15]))}
    frames = [
        BlenderFrame(
            RobotSnapshot(0.1 * number, number, Pose(), {"turn": 0.5 * number}, body_poses=cube),
            eye=(1.0, -1.5, 0.8),
            target=(1.0, 0.0, 0.15),
            field_of_view=30.0,
            file=folder / f"{number}.png",
        )
        for number in range(count)
    ]
    bodies = [BlenderBody(red, "object")]
    return BlenderJob(BlenderRobot(URDF, "base"), bodies, frames, width=size[0], height=size[1], samples=4)


@pytest.fixture
def stand_in(tmp_path: Path) -> StandIn:
    """Makes a program that takes the place of Blender's Python, to see what it is given and how its end is taken."""

    def make(body: str) -> Path:
        program = tmp_path / "python"
        program.write_text(STAND_IN.format(python=sys.executable, body=body))
        program.chmod(0o755)
        return program

    return make


def test_every_frame_is_reported_when_it_is_painted(
    tmp_path: Path, stand_in: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    told: list[Path] = []

    paint(_job(tmp_path), stand_in(PAINTS), told.append)

    assert told == [tmp_path / "0.png", tmp_path / "1.png"]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('sys.exit("no memory left")', "no memory left"),
        ("os.kill(os.getpid(), 9)", r"Blender has failed \(-9\)"),
        ("", "did not render"),
    ],
)
def test_when_blender_fails_its_last_words_are_reported(
    tmp_path: Path, stand_in: StandIn, body: str, words: str
) -> None:
    with pytest.raises(BlenderError, match=words):
        paint(_job(tmp_path), stand_in(body), lambda _: None)


def test_blender_is_ended_when_the_user_gives_up(tmp_path: Path, stand_in: StandIn) -> None:
    def give_up(_: Path) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        paint(_job(tmp_path), stand_in(PAINTS + "import time; time.sleep(600)"), give_up)


def test_links_are_where_the_joints_put_them() -> None:
    base = Pose.from_xyz_rpy((2.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2))

    poses = BlenderRobot(URDF, "base").link_poses(base, {"turn": np.pi / 2})

    assert poses["arm"].position == pytest.approx([2.0, 0.0, 0.4])
    assert poses["arm"].apply(np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx([1.0, 0.0, 0.4])


def test_without_an_installation_the_error_says_the_one_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("BESTMAN_BT_BLENDER_PYTHON", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(BlenderError, match="bestman-bt render --install-blender"):
        blender_python()
    monkeypatch.setenv("BESTMAN_BT_BLENDER_PYTHON", str(tmp_path / "none"))
    with pytest.raises(BlenderError, match="no such file"):
        blender_python()


def test_an_installation_that_fails_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr(painting, "_base_python", lambda: "/bin/false")

    with pytest.raises(BlenderError, match="an environment in .* failed"):
        install_blender(lambda _: None)

    assert not painting.environment_folder().exists()


def test_nothing_of_the_package_imports_blender() -> None:
    (package,) = bestman_bt.__path__
    imports = re.compile(r"^\s*(?:import|from)\s+(?:bpy|bmesh|mathutils)\b", re.MULTILINE)

    found = {file for file in Path(package).rglob("*.py") if imports.search(file.read_text(encoding="utf-8"))}

    assert found
    assert {file.parent for file in found} == {SCRIPT.parent}


def test_blender_paints_a_red_cube_red(tmp_path: Path) -> None:
    """With the real one, where there is one."""
    try:
        python = blender_python()
    except BlenderError as error:
        pytest.skip(str(error))
    job = _job(tmp_path, count=1)

    paint(job, python, lambda _: None)

    red, green, blue = np.asarray(Image.open(tmp_path / "0.png").convert("RGB"))[24, 32]
    assert red > 90
    assert red > 2 * green
    assert red > 2 * blue
