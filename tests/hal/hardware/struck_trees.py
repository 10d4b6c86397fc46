"""A robot with its twins and a session on it, which faults of its controllers strike while a tree runs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.fault_trials.client_trial import ClientTrial
from benchmarks.fault_trials.left_behind import LeftBehind
from benchmarks.fault_trials.trial import GRACE, UR, XARM, Trial, strike
from benchmarks.twin_faults import SEED, TASK, hardware_setup
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.twins.process import TwinProcess

SDKS = {XARM: ("xarm", "xarm"), UR: ("ur", "rtde_control")}
"""Robot → the extra of its arm and the module that comes with it."""
OVERDUE = 1.5
"""Seconds by which a machine that does other things, too, may be late with what it owes."""


@pytest.fixture(scope="module")
def robot_name(request: pytest.FixtureRequest) -> str:
    # `make test` installs them; another installation may be without the vendors' SDKs.
    for extra, sdk in (SDKS[request.param], ("rosbridge", "roslibpy")):
        pytest.importorskip(sdk, reason=f"the extra {extra} is not installed")
    return str(request.param)


@pytest.fixture(scope="module")
def twin(robot_name: str) -> Iterator[TwinProcess]:
    with TwinProcess(robot_name, TASK, SEED) as running:
        yield running


@pytest.fixture(scope="module")
def session(robot_name: str, twin: TwinProcess) -> Iterator[RobotSession]:
    """One for all faults of a robot; nothing of it stays behind."""
    left = LeftBehind()
    with open_session(hardware_setup(robot_name, twin)) as opened:
        yield opened
        left.note()
    assert left.after(GRACE) == []


def of_their_robots(*trials: Trial | ClientTrial) -> pytest.MarkDecorator:
    """Each trial on the robot that it is of."""
    cases = [pytest.param(trial.robot, trial, id=trial.name) for trial in trials]
    return pytest.mark.parametrize(("robot_name", "trial"), cases, indirect=["robot_name"], scope="module")


def robot_stops_and_recovers(twin: TwinProcess, session: RobotSession, trial: Trial) -> None:
    """In time, the leaf says why, and the recovery goes on."""
    report = strike(trial, twin, session)
    assert report.code in trial.codes, report.words
    assert report.words
    told = report.stopped if trial.stops else report.failed
    assert told is not None
    assert told < trial.allowed + OVERDUE
    assert (report.stopped is not None) is trial.stops
    assert report.at_rest
    assert report.recovered, [failure.why for failure in session.skills.failures]


FIXTURES = robot_name, twin, session
"""For a module of tests: under these names."""
