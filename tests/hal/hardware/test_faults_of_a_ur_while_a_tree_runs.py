"""Whatever goes wrong with a UR's controllers while a tree runs: the robot stops, the leaf says why, it goes on."""

from __future__ import annotations

import pytest

from benchmarks.fault_trials.trial import TRIALS, UR, Trial
from bestman_bt.runtime.robot_session import RobotSession
from hal.twins.process import TwinProcess
from tests.hal.hardware.struck_trees import FIXTURES, of_their_robots, robot_stops_and_recovers

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]

robot_name, twin, session = FIXTURES


@of_their_robots(*(trial for trial in TRIALS if trial.robot == UR))
def test_the_robot_stops_the_leaf_says_why_and_the_recovery_goes_on(
    twin: TwinProcess, session: RobotSession, trial: Trial
) -> None:
    robot_stops_and_recovers(twin, session, trial)
