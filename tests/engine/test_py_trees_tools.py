"""py_trees' own tools work on our trees, and both kinds of node work inside each other."""

from __future__ import annotations

import py_trees
import pytest

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    AlwaysFailure,
    AlwaysSuccess,
    Fallback,
    Inverter,
    ManualClock,
    Parallel,
    ReactiveSequence,
    Sequence,
    Sleep,
    StatefulAction,
    build_tree,
)


class Work(StatefulAction):
    """RUNNING once, then SUCCESS."""

    def on_load(self) -> None:
        self.halts = 0

    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return SUCCESS

    def on_halted(self) -> None:
        self.halts += 1


def sample() -> Sequence:
    return Sequence(
        "root", [AlwaysSuccess("yes"), Parallel("both", [Inverter("not", AlwaysFailure("no")), Work("work")])]
    )


def test_unicode_tree_shows_names_structure_and_states() -> None:
    tree = build_tree(sample(), clock=ManualClock())
    tree.tick_exactly_once()
    text = py_trees.display.unicode_tree(tree.root, show_status=True)
    lines = [line.strip() for line in text.splitlines()]
    assert lines == ["{-} root [*]", "--> yes [✓]", "/_/ both [*]", "-^- not [✓]", "--> no [✕]", "--> work [*]"]


def test_dot_tree_has_every_node() -> None:
    graph = py_trees.display.dot_tree(build_tree(sample()).root)
    assert len(graph.get_nodes()) >= 6


def test_a_behaviour_tree_ticks_ours_with_handlers_and_visitors() -> None:
    tree = build_tree(sample(), clock=ManualClock())
    behaviour_tree = py_trees.trees.BehaviourTree(tree.root)
    snapshot = py_trees.visitors.SnapshotVisitor()
    behaviour_tree.add_visitor(snapshot)
    calls: list[str] = []
    behaviour_tree.add_pre_tick_handler(lambda tree: calls.append("before"))
    behaviour_tree.add_post_tick_handler(lambda tree: calls.append("after"))
    behaviour_tree.setup(timeout=1)
    behaviour_tree.tick()
    by_id = {node.id: node.name for node in tree.nodes}
    assert {by_id[key]: status.name for key, status in snapshot.visited.items()} == {
        "yes": "SUCCESS",
        "no": "FAILURE",
        "not": "SUCCESS",
        "work": "RUNNING",
        "both": "RUNNING",
        "root": "RUNNING",
    }
    assert behaviour_tree.tip().name == "work"
    behaviour_tree.tick()
    assert tree.root.status == py_trees.common.Status.SUCCESS
    assert calls == ["before", "after"] * 2
    behaviour_tree.interrupt()
    behaviour_tree.shutdown()


def test_the_display_visitor_prints_our_tree(capsys: pytest.CaptureFixture[str]) -> None:
    tree = build_tree(sample(), clock=ManualClock())
    tree.add_visitor(py_trees.visitors.DisplaySnapshotVisitor())
    py_trees.trees.BehaviourTree(tree.root)
    visitor = py_trees.visitors.DisplaySnapshotVisitor()
    behaviour_tree = py_trees.trees.BehaviourTree(tree.root)
    behaviour_tree.add_visitor(visitor)
    behaviour_tree.tick()
    assert "work [*]" in capsys.readouterr().out


def test_iterate_walks_over_our_nodes() -> None:
    tree = build_tree(sample())
    assert [node.name for node in tree.root.iterate()] == ["yes", "no", "not", "work", "both", "root"]


def test_stopping_the_root_halts_what_runs_and_makes_all_invalid() -> None:
    tree = build_tree(sample(), clock=ManualClock())
    behaviour_tree = py_trees.trees.BehaviourTree(tree.root)
    behaviour_tree.tick()
    tree.root.stop(py_trees.common.Status.INVALID)
    assert tree.node("work").halts == 1
    assert {node.status for node in tree.nodes} == {py_trees.common.Status.INVALID}


def test_our_nodes_work_under_a_native_composite() -> None:
    ours = Sequence("ours", [AlwaysSuccess(), Work("work")])
    native = py_trees.composites.Sequence("native", memory=True, children=[ours, py_trees.behaviours.Running("after")])
    native.tick_once()
    assert native.status == py_trees.common.Status.RUNNING
    assert native.tip().name == "work"
    native.tick_once()
    assert (ours.status, native.tip().name) == (py_trees.common.Status.SUCCESS, "after")
    native.stop(py_trees.common.Status.INVALID)
    native.tick_once()
    assert native.tip().name == "work"


def test_a_native_selector_stops_our_running_node_when_it_preempts() -> None:
    ours = Work("work")
    guard = py_trees.behaviours.StatusQueue(
        "guard",
        queue=[py_trees.common.Status.FAILURE, py_trees.common.Status.SUCCESS],
        eventually=py_trees.common.Status.SUCCESS,
    )
    native = py_trees.composites.Selector("native", memory=False, children=[guard, ours])
    native.tick_once()
    assert ours.state == RUNNING
    native.tick_once()
    assert ours.halts == 1


def test_a_skipped_node_of_ours_does_not_hold_up_native_parents() -> None:
    for native, expected in (
        (py_trees.composites.Sequence("s", memory=True), py_trees.common.Status.SUCCESS),
        (py_trees.composites.Selector("f", memory=True), py_trees.common.Status.FAILURE),
    ):
        native.add_child(AlwaysSuccess("skipped", _skipIf="1 == 1"))
        native.tick_once()
        assert native.status == expected


def test_native_behaviours_and_subtrees_work_inside_ours() -> None:
    counter = py_trees.behaviours.TickCounter("count", duration=2, completion_status=py_trees.common.Status.SUCCESS)
    inner = py_trees.composites.Sequence("inner", memory=True, children=[counter])
    tree = build_tree(Sequence("root", [inner, AlwaysSuccess("last")]), clock=ManualClock())
    statuses = [tree.tick_exactly_once() for _ in range(3)]
    assert statuses == [RUNNING, RUNNING, SUCCESS]
    assert [child.name for child in tree.node("inner").children] == ["count"]


def test_halting_ours_stops_a_native_behaviour_inside() -> None:
    running = py_trees.behaviours.Running("forever")
    tree = build_tree(ReactiveSequence([running]))
    tree.tick_exactly_once()
    tree.halt()
    assert running.status == py_trees.common.Status.INVALID


def test_idioms_of_py_trees_hold_our_nodes() -> None:
    root = py_trees.idioms.oneshot(
        name="once", variable_name="done", behaviour=Sequence("ours", [AlwaysSuccess("yes")]),
        policy=py_trees.common.OneShotPolicy.ON_COMPLETION,
    )  # fmt: skip
    root.tick_once()
    assert root.status == py_trees.common.Status.SUCCESS


def test_a_visitor_on_our_tree_is_shown_each_ticked_node_and_detaches() -> None:
    tree = build_tree(Fallback("root", [AlwaysFailure("a"), AlwaysSuccess("b"), AlwaysSuccess("c")]))
    visitor = py_trees.visitors.SnapshotVisitor()
    tree.add_visitor(visitor)
    assert tree.tick_exactly_once() == SUCCESS
    names = {node.id: node.name for node in tree.nodes}
    assert [names[key] for key in visitor.visited] == ["a", "b", "root"]
    tree.remove_visitor(visitor)
    visitor.initialise()
    assert tree.tick_exactly_once() == SUCCESS
    assert visitor.visited == {}


def test_hooks_replace_a_tick_and_its_result() -> None:
    tree = build_tree(Sequence("root", [AlwaysFailure("no"), AlwaysSuccess("yes")]))
    no, yes = tree.node("no"), tree.node("yes")
    no.add_pre_tick(lambda node: SUCCESS)
    assert tree.tick_exactly_once() == SUCCESS

    def fail(node: object, status: int) -> int:
        assert status == SUCCESS
        return FAILURE

    yes.add_post_tick(fail)
    assert tree.tick_exactly_once() == FAILURE
    yes.remove_hook(fail)
    assert tree.tick_exactly_once() == SUCCESS
    assert yes.hooks is None


def test_a_pre_tick_hook_can_skip_a_node_and_a_monitor_sees_real_ticks_only() -> None:
    tree = build_tree(Sequence("root", [AlwaysFailure("no"), AlwaysSuccess("yes")]))
    seen: list[tuple[str, int]] = []
    for node in tree.nodes:
        node.add_tick_monitor(lambda node, status: seen.append((node.name, status)))
    tree.node("no").add_pre_tick(lambda node: SKIPPED)
    assert tree.tick_exactly_once() == SUCCESS
    assert seen == [("yes", SUCCESS), ("root", SUCCESS)]


def test_sleep_reads_the_simulated_clock() -> None:
    clock = ManualClock()
    tree = build_tree(Sleep(msec=300), clock=clock)
    assert tree.tick_while_running(period=0.1) == SUCCESS
    assert clock.now() == pytest.approx(0.3)
