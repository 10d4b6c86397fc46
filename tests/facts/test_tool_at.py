from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.messages import Pose
from bestman_bt.runtime.resolved_config import prepare
from tests.facts.scripted import ScriptedEnd
from tests.facts.staged import Staged, judged, why

REACH = {
    "scene": "policy_space",
    "predicate": "tool_at",
    "goals": [{"tool_at": {"goal": "hover", "height": ["10 cm", "30 cm"]}}],
}


def test_a_tool_that_stayed_where_it_was_is_reported_by_how_much_it_is_off(tmp_path: Path) -> None:
    result = judged(tmp_path, REACH, Staged())
    assert not result.success
    off = result.metrics["tool_error_mm"]
    assert off > 100
    assert f"{off:.0f} mm from the goal" in why(result)


def test_with_wide_tolerances_the_same_tool_is_there(tmp_path: Path) -> None:
    wide = {**REACH, "tolerances": {"position": "2 m", "tilt": "180 deg"}}
    assert judged(tmp_path, wide, Staged()).success


def test_the_goal_points_down_over_the_scenes_goal_at_a_height_that_the_seed_draws() -> None:
    heights = []
    for seed in (1, 2):
        setup = prepare(load_run("policy_reach", seed=seed))
        goal, place = setup.asked[0].pose, setup.world.goals["hover"]
        assert isinstance(goal, Pose)
        np.testing.assert_allclose(goal.position[:2], place.position[:2])
        np.testing.assert_allclose(goal.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-9)
        heights.append(float(goal.position[2] - place.position[2]))
        assert 0.06 <= heights[-1] <= 0.32
    assert heights[0] != heights[1]


def test_heights_the_wrong_way_round_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "task.yaml"
    path.write_text(
        "{tree: policy_reach, scene: policy_space, robot: diff_panda, "
        "goals: [{tool_at: {goal: hover, height: [30 cm, 10 cm]}}]}"
    )
    with pytest.raises(ConfigurationError, match="the smaller limit comes first"):
        prepare(load_run(path))


@pytest.mark.parametrize("seed", [1, 4])
@pytest.mark.parametrize("share", [0.99, 1.01])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_tool_is_held_to_its_tolerances_along_and_about_every_axis(seed: int, share: float, axis: int) -> None:
    end = ScriptedEnd("policy_reach", seed=seed)
    goal, tolerances = end.setup.asked[0].pose, end.setup.config.task.tolerances
    assert goal is not None
    for sign in (-1.0, 1.0):
        along, about = np.zeros(3), np.zeros(3)
        along[axis] = sign * share * tolerances.position
        end.truth.frames[end.tool_frame] = Pose(goal.position + along, goal.quaternion)
        verdict = end.verdict("tool_at")
        assert verdict.holds is (share < 1.0)
        assert verdict.metrics["tool_error_mm"] == pytest.approx(1e3 * share * tolerances.position)
        assert verdict.metrics["tool_error_deg"] == pytest.approx(0.0, abs=1e-5)
        about[axis] = sign * share * tolerances.tilt
        turned = goal @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), about)
        for quaternion in (turned.quaternion, -turned.quaternion):
            end.truth.frames[end.tool_frame] = Pose(turned.position, quaternion)
            verdict = end.verdict("tool_at")
            assert verdict.holds is (share < 1.0)
            assert verdict.metrics["tool_error_deg"] == pytest.approx(np.degrees(share * tolerances.tilt), abs=1e-4)
            assert ("turned away by 6°" in verdict.why) is (share > 1.0)
