"""The shipped policy picks the cup, as the simulator has it, told by perception alone where it stands."""

from __future__ import annotations

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import run_episode


@pytest.mark.slow
def test_the_shipped_policy_picks_the_cup_and_holds_it() -> None:
    result = run_episode(load_run("policy_pick", seed=4001))
    assert result.success, result.failure
    assert result.metrics["lifted_mm"] > 100
    assert result.audit["ground_truth_reads"] == 0
    assert result.audit["grasp_constraints"] == 0
    assert result.audit["collisions"] == 0
