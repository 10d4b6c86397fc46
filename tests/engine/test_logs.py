"""File logs and statistics: what they hold, and that a tree without them pays nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.engine import IDLE, RUNNING, SUCCESS, ManualClock, Tree, load_tree
from bestman_bt.engine.logs.btlog import BtLogWriter, LogError, read_btlog
from bestman_bt.engine.logs.observer import TreeObserver

HERE = Path(__file__).parent
XML = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence name="seq"><Script name="init" code="x := 1"/><SubTree ID="Sub" name="sub"/>
<AlwaysSuccess name="no" _skipIf="x == 1"/></Sequence></BehaviorTree>
<BehaviorTree ID="Sub"><Sleep name="nap" msec="100"/></BehaviorTree></root>"""

TRANSITIONS = [
    (0.0, "seq", RUNNING),
    (0.0, "init", SUCCESS),
    (0.0, "sub", RUNNING),
    (0.0, "sub/nap", RUNNING),
    (0.1, "sub/nap", SUCCESS),
    (0.1, "sub/nap", IDLE),
    (0.1, "sub", SUCCESS),
    (0.1, "init", IDLE),
    (0.1, "sub", IDLE),
    (0.1, "seq", SUCCESS),
    (0.1, "seq", IDLE),
]


@pytest.fixture
def tree() -> Tree:
    return load_tree(XML, clock=ManualClock(5.0))


def run(tree: Tree) -> None:
    assert tree.tick_while_running(period=0.05) == SUCCESS


def test_a_genuine_log_of_behaviortree_cpp_is_read() -> None:
    log = read_btlog(HERE / "sample.btlog")
    assert len(log.transitions) == 647
    assert (log.transitions[0].uid, log.transitions[0].status) == (1, RUNNING)
    assert log.transitions[0].time == pytest.approx(1081e-6)
    assert log.start == pytest.approx(1795235937.930504)
    assert log.xml.startswith('<root BTCPP_format="4">')


def test_a_btlog_holds_every_transition_with_the_trees_time(tree: Tree, tmp_path: Path) -> None:
    with BtLogWriter(tree, tmp_path / "run.btlog", start=1000.0):
        run(tree)
    log = read_btlog(tmp_path / "run.btlog")
    found = [(t.time, tree.nodes[t.uid - 1].path, t.status) for t in log]
    assert found == [(pytest.approx(time), path, status) for time, path, status in TRANSITIONS]
    assert log.start == 1000.0


def test_the_xml_of_a_btlog_has_the_form_of_groot2s(tree: Tree, tmp_path: Path) -> None:
    with BtLogWriter(tree, tmp_path / "run.btlog"):
        pass
    xml = read_btlog(tmp_path / "run.btlog").xml
    assert xml.startswith(
        '<root BTCPP_format="4">\n'
        '    <BehaviorTree ID="Main" _fullpath="">\n'
        '        <Sequence name="seq" _uid="1">\n'
        '            <Script name="init" _uid="2" code="x := 1"/>\n'
        '            <SubTree ID="Sub" _fullpath="sub" _uid="3"/>\n'
        '            <AlwaysSuccess name="no" _uid="5" _skipIf="x == 1"/>\n'
        "        </Sequence>\n"
        "    </BehaviorTree>\n"
        '    <BehaviorTree ID="Sub" _fullpath="sub">\n'
        '        <Sleep name="nap" _uid="4" msec="100"/>\n'
        "    </BehaviorTree>\n"
        "    <TreeNodesModel>\n"
    )


def test_a_log_that_was_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    data = (HERE / "sample.btlog").read_bytes()
    (tmp_path / "cut.btlog").write_bytes(data[:-4])
    assert len(read_btlog(tmp_path / "cut.btlog").transitions) == 646


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: b"PK" + data, "is not a .btlog file"),
        (lambda data: data[:18] + b"\x02" + data[19:], "has the .btlog version 2"),
        (lambda data: data[:400], "cut off within its XML"),
        (lambda data: data[:20], "damaged"),
        (lambda data: data[:-1] + b"\x63", "the status 99"),
    ],
)
def test_what_is_no_btlog_is_refused(damage, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.btlog"
    path.write_bytes(damage((HERE / "sample.btlog").read_bytes()))
    with pytest.raises(LogError, match=message):
        read_btlog(path)


def test_statistics_count_ticks_results_skips_and_time(tree: Tree) -> None:
    with TreeObserver(tree) as observer:
        run(tree)
        run(tree)
    nap, skipped = observer["sub/nap"], observer["no"]
    assert (nap.ticks, nap.successes, nap.failures, nap.transitions) == (6, 2, 0, 6)
    assert nap.seconds[RUNNING] == pytest.approx(0.2)
    assert (skipped.ticks, skipped.skips, skipped.transitions) == (2, 2, 0)
    assert nap.last_result == SUCCESS
    with pytest.raises(KeyError, match="there is no node 'other'"):
        observer["other"]


def test_a_closed_log_leaves_the_tree_as_it_was(tree: Tree, tmp_path: Path) -> None:
    tree.tick_exactly_once()
    before = [node.run.__qualname__ for node in tree.nodes]
    with TreeObserver(tree), BtLogWriter(tree, tmp_path / "a.btlog"):
        tree.tick_exactly_once()
    assert [node.run.__qualname__ for node in tree.nodes] == before
    assert all(node.log is None and node.hooks is None for node in tree.nodes)


def test_a_listener_attached_in_mid_run_sees_the_changes_from_then_on(tree: Tree) -> None:
    tree.tick_exactly_once()
    seen: list[tuple[int, int]] = []
    tree.subscribe(seen.extend)
    tree.clock.sleep(0.2)
    tree.tick_exactly_once()
    assert [(tree.nodes[uid - 1].path, state) for uid, state in seen] == [(p, s) for t, p, s in TRANSITIONS if t > 0]
