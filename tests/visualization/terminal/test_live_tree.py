from __future__ import annotations

import io

import pytest
from rich.console import Console

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.records.palette import LOOKS
from bestman_bt.visualization.terminal import LiveTree
from tests.visualization.conftest import changed, tree_of


def rendered(live_tree: LiveTree, height: int = 40, width: int = 100) -> list[str]:
    console = Console(file=io.StringIO(), width=width, height=height, force_terminal=False)
    console.print(live_tree)
    return console.file.getvalue().splitlines()


@pytest.fixture
def live_tree(fetch_tree):
    live = LiveTree(fetch_tree, title="fetch_cup")
    live.take(changed(0.5, *((uid, RUNNING) for uid in (1, 2))))
    live.take(changed(4.0, (2, SUCCESS), (3, RUNNING), (4, RUNNING)))
    live.take(changed(5.0, (5, SUCCESS), (6, RUNNING, "closing the fingers")))
    live.set_time(5.0, 0.5)
    return live


def test_the_whole_tree_is_drawn_with_the_state_of_every_node(live_tree):
    lines = rendered(live_tree)
    assert lines[0].rstrip() == "▶ fetch_cup   simulated 5.0 s   wall 0.5 s   10.0 × real time"
    assert [line.rstrip() for line in lines[2:12]] == [
        "▶ → fetch",
        "├─ ✓ to the table",
        "├─ ▶ ? get it",
        "│  ├─ ▶ → Sequence",
        "│  │  ├─ ✓ PlanGrasp",
        "│  │  └─ ▶ Grasp  closing the fingers",
        "│  └─ · → look again",
        "│     ├─ · LookAt",
        "│     └─ · second grasp",
        "└─ · put down",
    ]


def test_a_robot_that_is_not_simulated_has_no_simulated_time(fetch_tree):
    live = LiveTree(fetch_tree, title="fetch_cup", simulated=False)
    live.set_time(5.0, 5.1)
    assert rendered(live)[0].rstrip() == "· fetch_cup   real time 5.0 s"


def test_a_failure_keeps_its_reason_after_the_reset(live_tree):
    live_tree.take(changed(6.0, (6, FAILURE, "SLIPPED: the cup fell"), (6, IDLE)))
    assert "│  │  └─ ✗ Grasp  SLIPPED: the cup fell" in [line.rstrip() for line in rendered(live_tree)]


def test_progress_of_a_running_leaf_replaces_its_message(live_tree):
    live_tree.set_message(6, "12 mm wide")
    assert any("▶ Grasp  12 mm wide" in line for line in rendered(live_tree))


def test_the_last_events_stand_below_the_tree(fetch_tree):
    live = LiveTree(fetch_tree, event_lines=2)
    for stamp in (1.0, 2.0, 3.0):
        live.take(changed(stamp, (6, RUNNING)))
        live.take(changed(stamp, (6, FAILURE, "no")))
    assert [line.rstrip() for line in rendered(live)[-2:]] == [
        "[   3.00 s] ▶ Grasp running",
        "[   3.00 s] ✗ Grasp failure: no",
    ]


@pytest.mark.parametrize("height", [8, 10, 14, 18])
def test_a_tree_higher_than_the_terminal_fits_with_what_runs_in_sight(live_tree, height):
    lines = rendered(live_tree, height=height)
    assert len(lines) <= height
    assert any("─ ▶ Grasp  closing the fingers" in line for line in lines)


def test_what_does_not_run_is_folded_first(live_tree):
    lines = [line.rstrip() for line in rendered(live_tree, height=14)]
    assert "│  └─ · → look again  … 2 nodes" in lines
    assert not any("LookAt" in line for line in lines)


def test_a_chain_that_cannot_be_folded_is_shown_around_what_runs():
    live = LiveTree(tree_of(*((uid or None, f"n{uid}", "Retry") for uid in range(40))))
    live.take(changed(0.0, *((uid, RUNNING) for uid in range(1, 41))))
    lines = rendered(live, height=20, width=200)
    assert len(lines) <= 20
    assert any("▶ n39" in line for line in lines[2:-2])


def test_long_messages_are_cut_at_the_edge_of_the_terminal(live_tree):
    live_tree.set_message(6, "x" * 300)
    assert max(len(line.rstrip()) for line in rendered(live_tree, width=60)) <= 60


def test_markup_in_names_and_messages_is_shown_as_it_is(fetch_tree):
    live = LiveTree(tree_of((None, "[red]odd[/red]", "Grasp")))
    live.take(changed(0.0, (1, FAILURE, "[/] [bold]")))
    assert any("✗ [red]odd[/red]  [/] [bold]" in line for line in rendered(live))


def test_a_running_leaf_has_the_colour_of_running_and_its_branch_is_dim(live_tree):
    console = Console(width=100, height=40, force_terminal=True, color_system="truecolor", file=io.StringIO())
    (row,) = [
        segments
        for segments in console.render_lines(live_tree, pad=False)
        if "Grasp  " in "".join(s.text for s in segments)
    ]
    by_text = {segment.text: segment.style for segment in row}
    assert by_text["│  │  └─ "].dim
    label = by_text["▶ Grasp"]
    assert tuple(label.color.triplet) == LOOKS[RUNNING].dark
    assert label.bold
    assert not label.dim
