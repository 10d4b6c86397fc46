"""Literals that no tick can make sense of are found when a tree is loaded, before anything moves."""

from __future__ import annotations

import pytest

from bestman_bt.engine import FAILURE, TreeLoadError, load_tree
from bestman_bt.messages import Goals, Pose2D
from bestman_bt.runtime.plugins import node_registry
from tests.behaviours.at_the_table import failures_of, tick, tree_of


@pytest.mark.parametrize(
    ("node", "port", "value", "told"),
    [
        ('ComputePathToPose goal="0;0;0"', "planner_id", "grid_stars", "did you mean 'grid_astar'?"),
        (
            'ComputePathToPose goal="0;0;0"',
            "planner_id",
            "layered",
            "known: 'grid_astar', 'hybrid_astar', 'theta_star'",
        ),
        ("FollowPath", "controller_id", "DWB", "known: 'dwa', 'mppi', 'pure_pursuit'"),
        ('SmoothPath unsmoothed_path="{a}" smoothed_path="{b}"', "smoother_id", "savitzky", "known: 'simple_smoother'"),
        ("BackUp", "backup_dist", "0", "other than 0"),
        ("BackUp", "backup_dist", "inf", "a finite number"),
        ("DriveOnHeading", "dist_to_travel", "50cm", "a number alone, without a unit (metres"),
        ("Spin", "spin_dist", "90 deg", "a number alone, without a unit (radians"),
        ("Spin", "spin_dist", "inf", "a finite number"),
        ("Wait", "wait_duration", "-3", "of 0 or more"),
        ('DockAt goal="0;0;0"', "attempts", "0", "a whole number of 1 or more"),
        ('DockAt goal="0;0;0"', "approach", "0", "above 0"),
        ("Relocalise", "looks", "0", "a whole number of 1 or more"),
        ("Relocalise", "turn", "4", "below 3.14159"),
        ("ExploreAndMap", "max_time", "-1", "above 0"),
        ('NavigateTo goal="0;0;0"', "max_replans", "-5", "a whole number of 0 or more"),
        ('NavigateTo goal="0;0;0"', "max_replans", "2.5", "a whole number alone"),
        ("NavigateTo", "goal", "0;0;1e300", "theta is 1e+300 rad; at most two turns"),
        ("NavigateTo", "goal", "0;0;-12.6", "theta is -12.6 rad; at most two turns"),
        ("NavigateTo", "goal", "1e308;0;0", "x is 1e+308 m"),
        ("NavigateTo", "goal", "-100001;0;0", "x is -100001 m"),
        ("NavigateTo", "goal", "0;-100001;0", "y -100001 m"),
        ("NavigateThroughPoses", "goals", "0;0;0;1;0;90", "theta is 90 rad"),
        ('GoalReached goal="0;0;0"', "tolerance", "-1", "above 0"),
        ("Relocalise", "certainty", "1", "above 0 and below 1"),
        ('DetectObject object="cup" surface="table"', "min_confidence", "1.5", "from 0 to 1"),
        ('EstimatePose object="cup"', "min_confidence", "-0.1", "from 0 to 1"),
        ('SecondLook object="cup"', "max_yaw_width", "-1", "of 0 or more"),
        ('DetectHandle furniture="fridge"', "joint", "hinge", "known: 'prismatic', 'revolute'"),
        ('DetectHandle furniture="fridge"', "min_confidence", "2", "from 0 to 1"),
        ('ObjectVisible object="cup"', "max_age", "-1", "of 0 or more"),
        ('ObjectAt object="cup" goal="1;2;0.8"', "tolerance", "0", "above 0"),
        ('ObjectAt object="cup" goal="1;2;0.8"', "yaw_tolerance", "-0.1", "above 0"),
        ("ScanScene", "views", "0", "of 1 or more"),
        ('PlanGrasp object="cup" grasps="{g}"', "count", "0", "of 1 or more"),
        ('Grasp object="cup" grasps="{g}"', "force", "-3", "above 0"),
        ("Retreat", "distance", "-0.1", "of 0 or more"),
        ('FindPlacePose object="cup" surface="table" goal="1;2;0.8" pose="{p}"', "radius", "-1", "of 0 or more"),
        ('FindRoomIn object="cup" surface="d/1" pose="{p}"', "margin", "-1", "of 0 or more"),
        ('Open articulation="a/b" handle="h"', "opening", "-0.1", "of 0 or more"),
        ('Open articulation="a/b" handle="h" opening="0.3"', "force", "0", "above 0"),
        ('Open articulation="a/b" handle="h" opening="0.3"', "max_pull", "-1", "above 0"),
        ('Close articulation="a/b"', "max_push", "0", "above 0"),
        ('FindOpenStand articulation="a/b" handle="h" stand="{s}"', "opening", "-1", "of 0 or more"),
        ('IsOpen articulation="a/b"', "at_least", "-1", "of 0 or more"),
        ('IsOpen articulation="a/b"', "at_most", "inf", "a finite number"),
        ('Push object="cup" goal="1;2;0.8"', "speed", "0", "above 0"),
        ('Push object="cup" goal="1;2;0.8"', "max_force", "-15", "above 0"),
        ('RunPolicy policy="p"', "success", "luck", "known: 'goal', 'holding', 'lifted'"),
        ('RunPolicy policy="p"', "timeout", "0", "above 0"),
        ('RunPolicy policy="p"', "lift", "-1", "above 0"),
        ("ClearStop", "attempts", "0", "of 1 or more"),
        ("ClearStop", "wait", "-1", "of 0 or more"),
        ('FindUntidy seen="{s}" surface="t" region_x="0;1" region_y="0;1" untidy="{u}"', "margin", "-1", "0 or more"),
    ],
)
def test_a_wrong_literal_is_reported_with_its_line_its_port_and_what_is_right(node, port, value, told) -> None:
    with pytest.raises(TreeLoadError) as refused:
        load_tree(tree_of(f'\n<{node} {port}="{value}"/>'), node_registry())
    (problem,) = refused.value.problems
    assert (problem.line, problem.node, problem.field) == (2, node.split()[0], port)
    assert told in problem.message


@pytest.mark.parametrize(
    ("decorator", "told"),
    [
        ('RateController hz="0"', "port 'hz': 0.0 is not accepted"),
        ('RateController hz="-1"', "port 'hz': -1.0 is not accepted"),
        ('SpeedController min_rate="5" max_rate="1"', "min_rate is 5.0 Hz and max_rate 1.0 Hz"),
        ('SpeedController min_speed="0.5"', "min_speed is 0.5 m/s and max_speed 0.5 m/s"),
        ('DistanceController distance="-1"', "port 'distance': -1.0 is not accepted"),
    ],
)
def test_wrong_rates_and_distances_of_decorators_do_not_load(decorator, told) -> None:
    with pytest.raises(TreeLoadError) as refused:
        load_tree(tree_of(f"<{decorator}><AlwaysSuccess/></{decorator.split()[0]}>"), node_registry())
    assert told in str(refused.value)


def test_a_drive_to_one_side_at_a_speed_to_the_other_does_not_load_unless_one_is_an_entry() -> None:
    with pytest.raises(TreeLoadError, match="they should have the same sign"):
        load_tree(tree_of('<DriveOnHeading dist_to_travel="0.5" speed="-0.1"/>'), node_registry())
    tree = load_tree(tree_of('<DriveOnHeading name="drive" dist_to_travel="{d}" speed="-0.1"/>'), node_registry())
    assert tree.node("drive").get_input("speed") == -0.1


def test_looking_at_nothing_does_not_load() -> None:
    with pytest.raises(TreeLoadError, match="give a point, an object or a surface"):
        load_tree(tree_of("<LookAt/>"), node_registry())


def test_several_poses_need_no_goal_beside_them() -> None:
    tree = load_tree(tree_of('<NavigateThroughPoses name="drive" goals="0;0;0;1;0;1.5"/>'), node_registry())
    assert tree.node("drive").get_input("goals") == Goals([Pose2D(), Pose2D(1.0, 0.0, 1.5)])


@pytest.mark.parametrize("pose", [Pose2D(0.0, 0.0, 1e300), Pose2D(1e308, 0.0, 0.0)])
def test_a_pose_from_an_entry_that_is_nowhere_is_bad_input(driver, pose) -> None:
    for leaf, value in (("NavigateTo goal", pose), ("ComputePathThroughPoses goals", Goals([pose]))):
        tree = driver.load(tree_of(f'<{leaf}="{{entry}}"/>'))
        tree.blackboard.set("entry", value)
        assert tick(tree) == FAILURE
        code, words = failures_of(driver)[0]
        assert code == "bad_input"
        assert len(words) < 120
