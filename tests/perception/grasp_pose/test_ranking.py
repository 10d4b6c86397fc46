from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate
from bestman_bt.perception.grasp_pose.ranking import GraspRanking


def candidate(x: float, quality: float, clearance: float = 1.0) -> GraspCandidate:
    pose = Pose(np.array([x, 0.0, 0.0]))
    return GraspCandidate(pose, pose, pose, 0.04, 0.06, quality, "top", clearance)


def places(ranked: tuple) -> list[float]:
    return [float(grasp.candidate.grasp.position[0]) for grasp in ranked]


def test_the_better_grasp_comes_first() -> None:
    ranked = GraspRanking().rank([candidate(0.1, 0.4), candidate(0.2, 0.9), candidate(0.3, 0.6)])
    assert places(ranked) == [0.2, 0.3, 0.1]


def test_room_around_the_hand_counts() -> None:
    ranked = GraspRanking().rank([candidate(0.1, 0.80, clearance=0.002), candidate(0.2, 0.75, clearance=0.05)])
    assert places(ranked) == [0.2, 0.1]
    assert ranked[0].score == pytest.approx(0.75)
    assert ranked[1].score < 0.8


def test_what_cannot_be_reached_is_left_out_and_what_is_hard_to_reach_comes_later() -> None:
    reach = {0.1: 0.0, 0.2: 0.4, 0.3: 1.0}
    ranked = GraspRanking().rank(
        [candidate(x, quality) for x, quality in ((0.1, 0.9), (0.2, 0.8), (0.3, 0.5))],
        lambda pose: reach[float(pose.position[0])],
    )
    assert places(ranked) == [0.3, 0.2]
    assert [grasp.reachability for grasp in ranked] == [1.0, 0.4]


def test_reach_is_asked_for_no_more_often_than_needed() -> None:
    asked: list[float] = []

    def reach(pose: Pose) -> float:
        asked.append(float(pose.position[0]))
        return 1.0

    GraspRanking(enough=5).rank([candidate(x, 1.0 - x) for x in np.linspace(0, 0.9, 50)], reach)
    assert len(asked) == 5


def test_batches_give_the_same_ranking_as_single_questions() -> None:
    rng = np.random.default_rng(3)
    candidates = [candidate(float(x), float(q)) for x, q in rng.random((60, 2))]

    def reach(pose: Pose) -> float:
        return 0.0 if pose.position[0] < 0.4 else float(pose.position[0])

    single = GraspRanking().rank(candidates, reach)
    batch = GraspRanking().rank(candidates, reachability_of_all=lambda poses: [reach(pose) for pose in poses])
    assert places(single)[:12] == places(batch)[:12]


def test_the_first_few_differ_from_each_other() -> None:
    near = [candidate(0.1 + 0.001 * i, 0.9 - 0.001 * i) for i in range(10)]
    assert places(GraspRanking().rank([*near, candidate(0.5, 0.3)]))[:2] == [0.1, 0.5]


def test_no_candidates_give_no_ranking() -> None:
    assert GraspRanking().rank([]) == ()
