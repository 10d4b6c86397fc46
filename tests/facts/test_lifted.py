from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from tests.facts.scripted import ScriptedEnd, shifted
from tests.facts.staged import Staged, judged, why

LIFT = {
    "scene": "policy_table",
    "predicate": "lifted",
    "goals": [{"lifted": {"object": "cup", "source": "table", "height": "5 cm"}}],
}


def test_a_cup_that_nobody_touched_is_not_lifted(tmp_path: Path) -> None:
    result = judged(tmp_path, LIFT, Staged())
    assert not result.success
    told = why(result)
    assert "0 mm above its former place, 50 mm are required" in told
    assert "not in the hand" in told
    assert "touching the table" in told
    assert result.metrics == {"lifted_mm": pytest.approx(0.0, abs=1.0)}


def test_a_cup_that_stands_higher_but_in_no_hand_is_not_lifted(tmp_path: Path) -> None:
    """It was put on the tool's back, where it cannot stay: height alone is not enough."""

    def in_the_air(session: RobotSession) -> Pose:
        cup = session.setup.world.objects[0].pose
        return Pose(cup.position + np.array([0.0, 0.0, 0.4]), cup.quaternion)

    result = judged(tmp_path, {**LIFT, "tolerances": {"rest_time": "0.05 s"}}, Staged(moved={"cup": in_the_air}))
    assert result.metrics["lifted_mm"] > 50
    assert why(result).startswith("the cup is not in the hand, still moving")
    assert result.failure.why.startswith("teleports")


def test_a_lift_of_an_unknown_object_or_none_at_all_is_refused(tmp_path: Path) -> None:
    unknown = tmp_path / "unknown.yaml"
    unknown.write_text(
        "{tree: policy_pick, scene: policy_table, robot: diff_panda, goals: [{lifted: {object: cu, source: table}}]}"
    )
    with pytest.raises(ConfigurationError, match="did you mean 'cup'"):
        run_episode(load_run(unknown))
    none = tmp_path / "none.yaml"
    none.write_text("{tree: policy_pick, scene: policy_table, robot: diff_panda, predicate: lifted}")
    with pytest.raises(ConfigurationError, match="the predicate 'lifted' needs an entry {lifted: …}"):
        run_episode(load_run(none))


@pytest.fixture
def in_hand() -> ScriptedEnd:
    """The cup 1 mm higher than is asked, in the hand, at rest."""
    end = ScriptedEnd("policy_pick")
    end.put("cup", shifted(end.truth.poses["cup"], 0.2, -0.1, end.setup.asked[0].asked.height + 0.001))
    end.truth.touched.add("cup")
    return end


def test_a_cup_in_the_hand_above_where_it_stood_is_lifted(in_hand: ScriptedEnd) -> None:
    assert in_hand.verdict("lifted").holds


def test_a_cup_is_lifted_from_the_height_on_that_is_asked(in_hand: ScriptedEnd) -> None:
    in_hand.truth.poses["cup"] = shifted(in_hand.truth.poses["cup"], z=-0.002)
    verdict = in_hand.verdict("lifted")
    assert not verdict.holds
    assert "mm above its former place" in verdict.why


def test_a_cup_that_is_held_against_something_is_not_lifted(in_hand: ScriptedEnd) -> None:
    in_hand.truth.on["cup"] = ("shelf", "table")
    assert in_hand.verdict("lifted").why == "the cup is touching the shelf, touching the table"


def test_a_cup_that_nothing_holds_is_not_lifted(in_hand: ScriptedEnd) -> None:
    in_hand.truth.touched.clear()
    assert in_hand.verdict("lifted").why == "the cup is not in the hand"
    del in_hand.truth.poses["cup"]
    assert in_hand.verdict("lifted").why == "there is no cup in the scene"


@pytest.mark.parametrize(("slid", "why"), [(0.0009, ""), (0.0011, "the cup is still moving")])
def test_a_cup_that_slips_by_more_than_a_millimetre_is_not_lifted(in_hand: ScriptedEnd, slid: float, why: str) -> None:
    for way in ((slid, 0.0, 0.0), (0.0, 0.0, slid)):
        before = shifted(in_hand.truth.poses["cup"], *way)
        assert in_hand.verdict("lifted", cup=before).why == why
