from __future__ import annotations

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.evaluation.report.activities import Activity, activities, ended_by, work_of_nodes


def test_a_node_works_from_running_to_its_result() -> None:
    done = activities([(1.0, "a", RUNNING), (3.5, "a", SUCCESS), (3.5, "a", IDLE)], 4.0)

    assert done == [Activity("a", 1.0, 3.5, SUCCESS)]


def test_a_node_that_is_reset_while_it_runs_was_halted() -> None:
    assert activities([(1.0, "a", RUNNING), (2.0, "a", IDLE)], 4.0) == [Activity("a", 1.0, 2.0, IDLE)]


def test_a_node_that_returns_at_once_works_for_no_time() -> None:
    done = activities([(1.0, "a", FAILURE), (1.0, "a", IDLE), (2.0, "a", SKIPPED)], 4.0)

    assert done == [Activity("a", 1.0, 1.0, FAILURE), Activity("a", 2.0, 2.0, SKIPPED)]


def test_what_the_log_ends_within_is_still_running() -> None:
    assert activities([(1.0, "a", RUNNING)], 4.0) == [Activity("a", 1.0, 4.0, RUNNING)]


def test_a_tree_fails_by_the_last_leaf_that_fails_with_its_root() -> None:
    leaves = {"held", "grasp"}
    before = [(1.0, "held", FAILURE), (1.0, "grasp", RUNNING), (3.0, "held", FAILURE)]

    assert ended_by([*before, (3.0, "grasp", FAILURE), (3.0, "root", FAILURE)], "root", leaves) == ("grasp", 3.0)
    assert ended_by([*before, (3.0, "root", FAILURE), (3.0, "held", IDLE)], "root", leaves) == ("held", 3.0)
    assert ended_by([*before, (3.0, "root", SUCCESS)], "root", leaves) is None
    assert ended_by([*before, (4.0, "root", FAILURE)], "root", leaves) is None, "nothing failed with it"


def test_the_work_of_a_node_adds_up() -> None:
    done = [Activity("a", 0.0, 1.0, FAILURE), Activity("a", 2.0, 5.0, SUCCESS), Activity("b", 0.0, 5.0, IDLE)]

    work = work_of_nodes(done)

    assert (work["a"].count, work["a"].successes, work["a"].failures) == (2, 1, 1)
    assert (work["a"].seconds, work["a"].longest) == (4.0, 3.0)
    assert (work["b"].successes, work["b"].failures) == (0, 0)
