"""Nav2's selectors, and its names of outputs and algorithms: its trees load as they are."""

from __future__ import annotations

from bestman_bt.engine import FAILURE, SUCCESS, load_tree
from bestman_bt.runtime.plugins import node_registry
from tests.behaviours.at_the_table import tick, tree_of

PLAN = (
    '<Sequence><PlannerSelector selected_planner="{p}" default_planner="GridBased" topic_name="who_plans"/>'
    '<ControllerSelector selected_controller="{c}" default_controller="FollowPath"/>'
    '<ComputePathToPose goal="{goal}" path="{path}" planner_id="{p}" error_code_id="{code}" error_msg="{why}"/>'
    "</Sequence>"
)


def test_a_selector_names_its_default_until_somebody_writes_its_entry(driver) -> None:
    tree = driver.load(tree_of(PLAN))
    board = tree.blackboard
    board.set("goal", driver.skills.world.base.pose)
    assert tick(tree, 20) == SUCCESS
    assert (board.get("p"), board.get("c"), board.get("code")) == ("GridBased", "FollowPath", "")
    board.set("who_plans", "Dijkstra")
    assert tick(tree, 20) == FAILURE
    assert (board.get("p"), board.get("code")) == ("Dijkstra", "bad_input")
    assert "Dijkstra" in board.get("why")


def test_a_tree_with_nav2s_names_loads() -> None:
    checkers = "".join(
        f'<{name}Selector selected_{port}="{{{port}}}" default_{port}="x" topic_name="{port}_selector"/>'
        for name, port in (
            ("GoalChecker", "goal_checker"),
            ("ProgressChecker", "progress_checker"),
            ("PathHandler", "path_handler"),
            ("Smoother", "smoother"),
        )
    )
    follow = (
        '<FollowPath path="{path}" controller_id="FollowPath" goal_checker_id="{goal_checker}" error_code_id="{a}" '
        'error_msg="{b}" tracking_feedback="{c}"/><Spin error_code_id="{a}"/><Wait error_msg="{b}"/>'
        '<SmoothPath unsmoothed_path="{path}" smoothed_path="{path}" smoother_id="route_smoother" error_msg="{b}"/>'
    )
    tree = load_tree(tree_of(f"<Sequence>{checkers}{follow}</Sequence>"), node_registry())
    assert len(tree.nodes) == 9
