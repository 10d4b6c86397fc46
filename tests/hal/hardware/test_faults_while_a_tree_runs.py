"""Whatever goes wrong with a robot's controllers while a tree runs: the robot stops, the leaf says why, it goes on."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.fault_trials.client_trial import CLIENT_TRIALS, ClientTrial, run_client_trial
from benchmarks.fault_trials.left_behind import LeftBehind
from benchmarks.fault_trials.trial import GRACE, TRIALS, UR, XARM, Trial, strike
from benchmarks.twin_faults import SEED, TASK, hardware_setup
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.twins.process import TwinProcess

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]

CLIENTS = tuple(f"client/{XARM} {what}" for what in ("arm killed", "arm stopped", "base all killed"))
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


# These come first: while the session is open, nobody else may command the robot.
@of_their_robots(*(trial for trial in CLIENT_TRIALS if trial.name in CLIENTS))
def test_a_client_that_is_killed_or_stopped_leaves_the_robot_at_rest_and_nothing_behind(
    robot_name: str, twin: TwinProcess, trial: ClientTrial
) -> None:
    report = run_client_trial(trial, twin, hardware_setup(robot_name, twin))
    assert report.rest < trial.allowed + OVERDUE, report.words
    assert report.orphans == ()
    assert report.code == trial.exit_code, report.words


@of_their_robots(*TRIALS)
def test_the_robot_stops_the_leaf_reports_why_and_the_recovery_goes_on(
    twin: TwinProcess, session: RobotSession, trial: Trial
) -> None:
    report = strike(trial, twin, session)
    assert report.code in trial.codes, report.words
    assert report.words
    told = report.stopped if trial.stops else report.failed
    assert told is not None
    assert told < trial.allowed + OVERDUE
    assert (report.stopped is not None) is trial.stops
    assert report.at_rest
    assert report.recovered, [failure.why for failure in session.skills.failures]
