from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration import ConfigurationError, load_run, load_task
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.messages import Pose
from bestman_bt.runtime import Session
from tests.evaluation.predicates.staged import Staged, judged, why

LIFT = {
    "scene": "policy_table",
    "predicate": "lifted",
    "lift": {"object": "cup", "source": "table", "height": "5 cm"},
}


def test_a_cup_that_nobody_touched_is_not_lifted(tmp_path: Path) -> None:
    result = judged(tmp_path, LIFT, Staged())
    assert not result.success
    told = why(result)
    assert "0 mm above where it stood, 50 mm are asked" in told
    assert "not in the hand" in told
    assert "touching the table" in told
    assert result.metrics == {"lifted_mm": pytest.approx(0.0, abs=1.0)}


def test_a_cup_that_stands_higher_but_in_no_hand_is_not_lifted(tmp_path: Path) -> None:
    """It was put on the tool's back, where it cannot stay: height alone is not enough."""

    def in_the_air(session: Session) -> Pose:
        cup = session.setup.world.objects[0].pose
        return Pose(cup.position + np.array([0.0, 0.0, 0.4]), cup.quaternion)

    result = judged(tmp_path, {**LIFT, "tolerances": {"rest_time": "0.05 s"}}, Staged(moved={"cup": in_the_air}))
    assert result.metrics["lifted_mm"] > 50
    assert why(result).startswith("the cup is not in the hand, still moving")


def test_a_lift_of_an_unknown_object_or_none_at_all_is_refused(tmp_path: Path) -> None:
    unknown = tmp_path / "unknown.yaml"
    unknown.write_text("{tree: policy_pick, scene: policy_table, robot: diff_panda, lift: {object: cu, source: table}}")
    with pytest.raises(ConfigurationError, match="did you mean 'cup'"):
        run_episode(load_run(unknown))
    none = tmp_path / "none.yaml"
    none.write_text("{tree: policy_pick, scene: policy_table, robot: diff_panda, predicate: lifted}")
    with pytest.raises(ConfigurationError, match="the predicate 'lifted' needs a lift"):
        run_episode(load_run(none))
    assert load_task("policy_pick").lift is not None
