"""A stop that is posted to the monitor while a robot drives: in simulation, and behind the protocol twins."""

from __future__ import annotations

import json
import time
from pathlib import Path

import httpx
import numpy as np
import pytest

from hal.twins.process import TwinProcess
from hal.twins.remote_truth import RemoteTruth
from tests.cli.command_line import Program, wait_for
from tests.hal.twinned import twin_settings

pytestmark = [pytest.mark.real_time, pytest.mark.slow]

DRIVE = '<root BTCPP_format="4"><BehaviorTree ID="Drive"><NavigateTo goal="1.5;-0.4;0"/></BehaviorTree></root>'


def believed_positions(run: Path) -> list[tuple[float, float]]:
    """Of the base, as the run tells them."""
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines() if line.endswith("}")]
    return [tuple(event["base"][:2]) for event in events if event["event"] == "robot"]


def stopped_while_it_drives(run: Program, folder: Path) -> Path:
    """Post a stop once the base has gone 0.2 m; returns the run's folder."""
    monitor = Program("monitor", "--no-browser", "--port", "0", "--end-when-idle", "60", folder=folder)
    assert monitor.process.stdout is not None
    address = monitor.process.stdout.readline().split()[-1]
    try:
        made = wait_for(folder, "runs/*/control.sock").parent
        with httpx.Client(base_url=address) as http:
            end = time.monotonic() + 120.0
            while not _gone(made, 0.2):
                assert time.monotonic() < end, "it does not drive"
                assert run.process.poll() is None, run.answer().err
                time.sleep(0.02)
            (listed,) = http.get("/api/runs").json()["runs"]
            answer = http.post(f"/api/runs/{listed['id']}/stop")
        assert (answer.status_code, answer.json()["ok"]) == (200, True)
    finally:
        monitor.process.kill()
        monitor.process.wait()
    return made


def _gone(run: Path, least: float) -> bool:
    try:
        positions = believed_positions(run)
    except (OSError, ValueError, KeyError):
        return False
    return len(positions) > 1 and float(np.linalg.norm(np.subtract(positions[-1], positions[0]))) > least


def assert_stopped(run: Program, made: Path) -> None:
    """The run has ended as cancelled by the stop."""
    answer = run.answer()
    assert (answer.code, answer.document["outcome"]) == (130, "cancelled"), answer.err
    assert answer.document["failure"]["why"] == "stopped through the control channel"
    assert json.loads((made / "result.json").read_text()) == answer.document
    assert not _gone(made, 3.0), "it went on to its goal"


def test_a_simulated_robot_that_drives(tmp_path: Path) -> None:
    (tmp_path / "drive.xml").write_text(DRIVE)
    run = Program("run", "drive.xml", "--scene", "kitchen", "--seed", 1, "--real-time", "--json", folder=tmp_path)
    assert_stopped(run, stopped_while_it_drives(run, tmp_path))


@pytest.mark.alone
def test_a_robot_that_drives_behind_its_twins(tmp_path: Path) -> None:
    pytest.importorskip("xarm", reason="the extra xarm is not installed")
    (tmp_path / "drive.xml").write_text(DRIVE)
    with TwinProcess("diff_xarm6", "kitchen", seed=1) as twin:
        truth = RemoteTruth(twin.judge_socket)
        start = truth.base_pose().position
        settings = [word for key, value in twin_settings(twin).items() for word in ("--set", f"robot.{key}={value}")]
        arguments = ("run", "drive.xml", "--robot", "diff_xarm6", "--scene", "kitchen", "--seed", 1)
        run = Program(*arguments, "--driver", "hardware", *settings, "--json", folder=tmp_path)
        made = stopped_while_it_drives(run, tmp_path)
        assert_stopped(run, made)
        stopped = truth.base_pose().position
        assert np.linalg.norm(stopped - start) > 0.2
        time.sleep(1.0)
        assert np.linalg.norm(truth.base_pose().position - stopped) < 0.002
