from __future__ import annotations

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.visualization import NodeTransition, TreeDescription
from bestman_bt.visualization.rerun.state_lanes import lane_entities


def lane(recorded, entity: str) -> list[tuple[float, str]]:
    return [(row["sim_time"], row["StateChange:state"][0]) for row in recorded.rows(entity)]


def test_lanes_are_sorted_as_the_tree_is_read(fetch_nodes):
    lanes = lane_entities(TreeDescription(fetch_nodes))
    assert lanes[1] == "node/01_to_the_table"
    assert lanes[5] == "node/05_Grasp"
    assert [lanes[uid] for uid in range(10)] == sorted(lanes.values())


def test_a_lane_shows_when_a_node_ran_and_how_it_ended(record, recorded):
    with record() as recorder:
        recorder.transitions([NodeTransition(5, RUNNING, 1.0)])
        recorder.transitions([NodeTransition(5, FAILURE, 2.0)])
        recorder.transitions([NodeTransition(5, IDLE, 3.0), NodeTransition(5, RUNNING, 3.0)])
    assert lane(recorded(), "/node/05_Grasp") == [(1.0, "RUNNING"), (2.0, "FAILURE"), (3.0, "RUNNING")]


def test_a_result_that_is_cleared_in_the_same_tick_stays_until_the_next_one(record, recorded):
    with record() as recorder:
        recorder.transitions([NodeTransition(4, SUCCESS, 1.0), NodeTransition(4, IDLE, 1.0)])
        recorder.transitions([NodeTransition(0, RUNNING, 2.0)])
        recorder.transitions([NodeTransition(9, RUNNING, 3.0)])
    assert lane(recorded(), "/node/04_PlanGrasp") == [(1.0, "SUCCESS"), (2.0, "")]


def test_a_condition_that_holds_at_every_tick_is_one_bar(record, recorded):
    with record() as recorder:
        for k in range(1, 20):
            recorder.transitions([NodeTransition(4, SUCCESS, 0.1 * k), NodeTransition(4, IDLE, 0.1 * k)])
    assert [state for _, state in lane(recorded(), "/node/04_PlanGrasp")] == ["SUCCESS"]
