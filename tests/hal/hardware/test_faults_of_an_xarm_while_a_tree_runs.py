"""Whatever goes wrong with an xArm's controllers while a tree runs: the robot stops, the leaf says why, it goes on."""

from __future__ import annotations

import pytest

from benchmarks.fault_trials.client_trial import CLIENT_TRIALS, ClientTrial, run_client_trial
from benchmarks.fault_trials.trial import TRIALS, XARM, Trial
from benchmarks.twin_faults import hardware_setup
from bestman_bt.runtime.robot_session import RobotSession
from hal.twins.process import TwinProcess
from tests.hal.hardware.struck_trees import FIXTURES, OVERDUE, of_their_robots, robot_stops_and_recovers

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]

robot_name, twin, session = FIXTURES

CLIENTS = tuple(f"client/{XARM} {what}" for what in ("arm killed", "arm stopped", "base all killed"))


# These come first: while the session is open, nobody else may command the robot.
@of_their_robots(*(trial for trial in CLIENT_TRIALS if trial.name in CLIENTS))
def test_a_client_that_is_killed_or_stopped_leaves_the_robot_at_rest_and_nothing_behind(
    robot_name: str, twin: TwinProcess, trial: ClientTrial
) -> None:
    report = run_client_trial(trial, twin, hardware_setup(robot_name, twin))
    assert report.rest < trial.allowed + OVERDUE, report.words
    assert report.orphans == ()
    assert report.code == trial.exit_code, report.words


@of_their_robots(*(trial for trial in TRIALS if trial.robot == XARM))
def test_the_robot_stops_the_leaf_says_why_and_the_recovery_goes_on(
    twin: TwinProcess, session: RobotSession, trial: Trial
) -> None:
    robot_stops_and_recovers(twin, session, trial)
