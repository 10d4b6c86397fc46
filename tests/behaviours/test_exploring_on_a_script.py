"""ExploreAndMap on a base, a map and an explorer that a test scripts: what it looks at on the way, what it believes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import RUNNING, SUCCESS
from bestman_bt.messages import OccupancyGrid, Path2D, Pose2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.slam.frontiers import FrontierView
from bestman_bt.world_model.world_model import BasePose
from tests.behaviours.scripted import UNDER_WAY, load, run, scripted_skills

SQUARE = Footprint(np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]))
START, LENGTH = Pose2D(1.0, -0.5, 0.8), 6.0
END = START @ Pose2D(LENGTH, 0.0, 0.0)


class Floor:
    """Free but for a disc of 0.4 m around ``blocked``, metres along the path from START to END."""

    footprint = SQUARE

    def __init__(self, blocked: float) -> None:
        self._place = (START @ Pose2D(blocked, 0.0, 0.0)).xy

    def clearance_at(self, pose: Pose2D) -> float:
        return 1.0

    def distance_at(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - self._place, axis=1) - 0.4


@pytest.fixture
def skills() -> Any:
    """``floor``: as it is seen. ``views``: where to look from, the next ones each time that is asked."""
    skills = scripted_skills("navigate_kitchen", START)
    skills.floor, skills.views = Floor(99.0), [[FrontierView(END, 5.0, LENGTH, 1.0)], []]
    grid = OccupancyGrid(np.zeros((4, 4), np.int8), 0.05, (0.0, 0.0))
    picture = SimpleNamespace(cloud=lambda: SimpleNamespace(points=np.zeros((0, 3))), viewpoint=np.zeros(3))
    skills.camera = SimpleNamespace(capture=lambda: SimpleNamespace(in_map=picture))
    skills.footprint = lambda: SQUARE
    skills.stops, skills.told = 0, []
    skills.base.stop = lambda: setattr(skills, "stops", skills.stops + 1)
    skills.base.localise_by = lambda localizer: "the one before"
    skills.base.believe = lambda *told: skills.told.append(told)
    skills.slam = SimpleNamespace(grid=grid, estimate=SimpleNamespace(loop_closures=0))
    skills.exploration = SimpleNamespace(tour=lambda *_: skills.views.pop(0), is_useful=lambda *_: True)
    skills.global_planning = SimpleNamespace(plan=lambda *_: Path2D(np.array([START.xy, END.xy]), END))
    skills.costmap = SimpleNamespace(of_grid=lambda *_: skills.floor)
    return skills


@pytest.mark.parametrize(("at", "blocked", "stops"), [(0.0, 1.2, True), (0.0, 4.0, False), (3.0, 4.0, True)])
def test_the_next_metres_of_the_path_from_where_the_base_is_have_to_stay_free(
    skills: Any, at: float, blocked: float, stops: bool
) -> None:
    skills.base.ends["follow"] = [UNDER_WAY]
    tree = load(skills, "<ExploreAndMap/>")
    assert run(skills, tree, 10) == RUNNING
    skills.world.base = BasePose(START @ Pose2D(at, 0.0, 0.0), 0.01, 0.01, 0.0)
    before = skills.stops
    skills.floor = Floor(blocked)
    run(skills, tree, 40)
    assert (skills.stops > before) is stops
    tree.halt()


def test_the_final_base_pose_is_as_uncertain_as_the_given_start_pose(skills: Any) -> None:
    skills.world.base = BasePose(START, 0.03, 0.02, 0.0)
    tree = load(skills, "<ExploreAndMap/>")
    follow = skills.base._begin

    def begin(name: str, *arguments: Any) -> Any:
        if name == "follow":
            skills.world.base = BasePose(END, 0.01, 0.005, 0.0)
        return follow(name, *arguments)

    skills.base._begin = begin
    assert run(skills, tree) == SUCCESS
    ((pose, position_std, heading_std),) = skills.told
    assert pose == END
    assert position_std == pytest.approx(math.hypot(0.01, 0.03 + 0.02 * LENGTH))
    assert heading_std == pytest.approx(math.hypot(0.005, 0.02))
