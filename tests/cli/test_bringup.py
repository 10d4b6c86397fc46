"""bestman-bt robot bringup: what it refuses before it connects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer

ROBOT = """\
base_frame: base_link
parts:
  base: {part: differential_base}
  column: {part: column, mount: base_link, xyz: [15 cm, 0, 30 cm]}
  arm: {part: xarm6_arm, mount: column_top}
connections:
  arm_controller: {driver: xarm, parts: [arm]}
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("diff_panda",), "connections: is missing, so there is nothing to bring up"),
        (("diff_pandaa",), "did you mean 'diff_panda'"),
        (("cell.yaml",), "connections.arm_controller.address: is missing"),
        (("cell.yaml", "--step", "jump"), "--step jump: no such step; there are identity, limits, tool,"),
        (("cell.yaml", "--set", "scene.seed=1"), "should begin with robot."),
        (("cell.yaml", "--board", "1 2 3"), "--board: should be six finite numbers, x y z in metres"),
        (("cell.yaml", "--board", "1 2 3"), "roll pitch yaw in radians, got '1 2 3'"),
        (("cell.yaml", "--board", "nan 0 0 0 0 0"), "should be six finite numbers"),
        pytest.param(
            ("cell.yaml", "--set", "robot.connections.arm_controller.address=127.0.0.250"),
            "no xArm controller answers",
            marks=pytest.mark.slow,  # connections have a process of their own
        ),
    ],
)
def test_wrong_input_is_reported_and_nothing_is_signed(
    bestman_bt: Callable[..., Answer],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    arguments: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("cell.yaml").write_text(ROBOT)
    answer = bestman_bt("robot", "bringup", *arguments)
    assert (answer.code, answer.out) == (2, "")
    assert words in answer.err
    assert not Path("cell.bringup").exists()
