from __future__ import annotations

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.visualization.rerun.tree_graph import lane_entities
from tests.visualization.conftest import changed, nodes_of


def lane(recorded, entity: str) -> list[tuple[float, str]]:
    return [(row["sim_time"], row["StateChange:state"][0]) for row in recorded.rows(entity)]


def test_lanes_are_sorted_as_the_tree_is_read(fetch_tree):
    lanes = lane_entities(nodes_of(fetch_tree))
    assert lanes[2] == "node/01_to_the_table"
    assert lanes[6] == "node/05_Grasp"
    assert [lanes[uid] for uid in range(1, 11)] == sorted(lanes.values())


def test_a_lane_shows_when_a_node_ran_and_how_it_ended(record, recorded):
    with record() as recorder:
        recorder.changes(changed(1.0, (6, RUNNING)))
        recorder.changes(changed(2.0, (6, FAILURE)))
        recorder.changes(changed(3.0, (6, IDLE), (6, RUNNING)))
    assert lane(recorded(), "/node/05_Grasp") == [(1.0, "RUNNING"), (2.0, "FAILURE"), (3.0, "RUNNING")]


def test_a_result_that_is_cleared_in_the_same_tick_stays_until_the_next_one(record, recorded):
    with record() as recorder:
        recorder.changes(changed(1.0, (5, SUCCESS), (5, IDLE)))
        recorder.changes(changed(2.0, (1, RUNNING)))
        recorder.changes(changed(3.0, (10, RUNNING)))
    assert lane(recorded(), "/node/04_PlanGrasp") == [(1.0, "SUCCESS"), (2.0, "")]


def test_a_condition_that_holds_at_every_tick_is_one_bar(record, recorded):
    with record() as recorder:
        for k in range(1, 20):
            recorder.changes(changed(0.1 * k, (5, SUCCESS), (5, IDLE)))
    assert [state for _, state in lane(recorded(), "/node/04_PlanGrasp")] == ["SUCCESS"]
