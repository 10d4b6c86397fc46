"""Robots of other parts: a base with a lidar drives, an arm on a stand picks and places, two arms bring two things."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession, session

WITHOUT_A_LOOK = """
<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
  <BelieveObject object="cup" pose="{cup}" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
  <PlaceOn object="cup" pose="{place}"/>
  <Release object="cup" surface="table"/>
  <Retreat posture="carry"/>
</Sequence></BehaviorTree></root>
"""


def test_a_base_with_a_lidar_and_nothing_else_drives() -> None:
    result = run_episode(load_run("navigate_kitchen", robot="turtle", seed=31000))
    assert result.success
    assert result.metrics["final_error_mm"] < 20


@pytest.mark.slow
def test_an_arm_on_a_stand_moves_a_thing_on_its_table() -> None:
    result = run_episode(load_run("pick_bench", seed=32000))
    assert result.success
    assert result.metrics["place_error_mm"] < 20


@pytest.mark.slow
def test_two_arms_bring_two_things_in_one_drive() -> None:
    seen: set[tuple[str, ...]] = set()

    def watch(opened: RobotSession, tree: Tree) -> Callable[[], None]:
        hands = opened.skills.world.hands
        return lambda: seen.add(tuple(f"{arm} {held.name}" for arm, held in sorted(hands.items())))

    result = run_episode(load_run("bring_two", seed=1), watch=watch)
    assert result.success
    assert result.audit["findings"] == []
    assert result.audit["collisions"] == 0
    assert ("left cup", "right can") in seen


@pytest.mark.slow
def test_an_arm_without_a_camera_picks_and_places_by_poses_of_the_blackboard(tmp_path: Path) -> None:
    lines = find_data("robot", "bench_arm").read_text().splitlines()
    blind = tmp_path / "blind.yaml"
    blind.write_text("\n".join(line for line in lines if not line.startswith(("  mast:", "  camera:"))))
    with session(scene="bench", robot=blind, seed=1) as opened:
        cup = next(thing.pose for thing in opened.setup.world.objects if thing.name == "cup")
        tree = opened.load(WITHOUT_A_LOOK)
        tree.blackboard.set("cup", cup)
        tree.blackboard.set("place", Pose(cup.position + np.array([0.0, 0.12, 0.0]), cup.quaternion))
        assert opened.executor(tree).run().succeeded
