"""bestman-bt twin: what it tells, and what it refuses."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer

ROBOT = Path(__file__).parents[1] / "hal" / "xarm" / "xarm6_on_a_base.yaml"
COMMAND = [sys.executable, "-m", "bestman_bt.cli.main", "twin"]


def refused(*arguments: str) -> str:
    """What a call says that ends with exit code 2."""
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    return done.stderr


@pytest.mark.slow
def test_twins_report_where_they_are_take_faults_and_end_with_ctrl_c() -> None:
    arguments = [*COMMAND, "--robot", str(ROBOT), "--scene", "pick_place_table", "--json"]
    with (
        subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as twins,
        contextlib.ExitStack() as ends,
    ):
        ends.callback(twins.kill)  # leaving Popen's block waits for it, also where a check has failed
        assert twins.stdout is not None
        told = json.loads(twins.stdout.readline())
        address = told["addresses"]["arm_controller"]
        faults_folder = Path(told["faults"]).parent
        assert address.startswith("127.0.0.")
        bringup = faults_folder / "xarm6_on_a_base.twin-bringup"  # without which a first run would be slow
        assert told["settings"] == [
            f"robot.connections.arm_controller.address={address}",
            f"robot.bringup={bringup}",
        ]
        assert "twin: true" in bringup.read_text()
        assert told["judge"] is None
        faults = Path(told["faults"])
        assert faults.stat().st_mode & 0o777 == 0o600
        assert "there are" in refused("--fault", "arm_controller:flood", "--at", str(faults))
        assert "there are arm_controller" in refused("--fault", "leg:drop", "--at", str(faults))
        assert "takes no value" in refused("--fault", "arm_controller:drop:3", "--at", str(faults))
        good = [*COMMAND, "--fault", "arm_controller:delay:0.1", "--at", str(faults)]
        assert subprocess.run(good, check=False).returncode == 0
        twins.send_signal(signal.SIGINT)
        assert twins.wait(timeout=10) == 0
    assert not faults.exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robot", "diff_panda", "--scene", "kitchen"), "has no connections"),
        (("--robot", "diff_pandaa"), "did you mean 'diff_panda'"),
        (("--robot", str(ROBOT), "--set", "goals.0.placed.object=cup"), "should begin with robot. or scene."),
        (("--robot", str(ROBOT), "--board", "nan 0 0 0 0 0"), "--board: should be six finite numbers, x y z in metres"),
        (("--robot", str(ROBOT), "--board", "0 0 1 0 0 inf"), "got '0 0 1 0 0 inf'"),
        (("--robot", str(ROBOT), "--board", "1, 2, x, 0, 0, 0"), "got '1, 2, x, 0, 0, 0'"),
        (("--fault", "arm_controller:drop"), "--at the socket"),
        (("--fault", "arm_controller:drop", "--at", "/nope"), "--at /nope: no twins answer there"),
        (("--fault", "arm_controller:delay:-5", "--at", "/nope"), "a delay should be 0 to 60 seconds"),
        (("--fault", "arm_controller:delay", "--at", "/nope"), "(CONNECTION:delay:0.2), got nothing"),
        (("--fault", "arm_controller:delay:soon", "--at", "/nope"), "got 'soon'"),
    ],
)
def test_wrong_input_is_reported(bestman_bt: Callable[..., Answer], arguments: tuple[str, ...], words: str) -> None:
    answer = bestman_bt("twin", *arguments)
    assert (answer.code, answer.out) == (2, "")
    assert words in answer.err
