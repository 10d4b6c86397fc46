"""What decides when a child is ticked next: where it was done the last time, and nothing from before a halt."""

from __future__ import annotations

from typing import Any

import numpy as np

from bestman_bt.engine import FAILURE, RUNNING
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.world_model.world_model import BasePose
from tests.behaviours.scripted import load, run, scripted_skills


def paced(skills: Any, decorator: str, **entries: Any) -> Any:
    body = f"<PipelineSequence>{decorator}<Wait wait_duration='99'/></PipelineSequence>"
    return load(skills, body, **entries)


def test_a_distance_counts_from_where_the_child_was_done_the_last_time() -> None:
    skills = scripted_skills("navigate_kitchen")
    count = '<DistanceController distance="0.5"><Script code="n := n + 1"/></DistanceController>'
    tree = paced(skills, count, n=0)
    for way, ticked in ((0.0, 1), (0.4, 1), (0.6, 2), (1.0, 2), (1.2, 3), (0.8, 3), (0.6, 4)):
        skills.world.base = BasePose(Pose2D(-0.8 * way, 0.6 * way, 2.0), 0.01, 0.01, 0.0)
        assert run(skills, tree, 1) == RUNNING
        assert tree.blackboard.get("n") == ticked, way
    tree.halt()
    assert run(skills, tree, 1) == RUNNING
    assert tree.blackboard.get("n") == 5


def path_of(length: float) -> Path2D:
    return Path2D(np.array([[3.0, -length], [3.0, 0.0]]), Pose2D(3.0, 0.0, 1.5))


def test_a_longer_path_is_compared_with_none_from_before_a_halt() -> None:
    skills = scripted_skills("navigate_kitchen")
    tree = paced(skills, '<PathLongerOnApproach path="{path}"><AlwaysFailure/></PathLongerOnApproach>')
    for halted in (True, False):
        tree.blackboard.set("path", path_of(2.5))
        assert run(skills, tree, 1) == RUNNING
        if halted:
            tree.halt()
        tree.blackboard.set("path", path_of(5.1))
        assert run(skills, tree, 1) == (RUNNING if halted else FAILURE)
