"""Ticks and loads benchmark trees with this engine and its peers, alternately in one process.

    python benchmarks/engine.py [--json] [--rounds N] [--trees wide100,chain50]

Peers: behaviortreepy (the Python binding of BehaviorTree.CPP, with Python leaves), py_trees' ``tick_once``, and
py_trees with a SnapshotVisitor. All leaves are as short as each library allows. A figure is the best round's mean,
in microseconds a tick.
"""

from __future__ import annotations

import argparse
import gc
import json
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import py_trees
from py_trees.common import Status as PyTreesStatus

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    NodeRegistry,
    PortInformation,
    StatefulAction,
    SyncAction,
    Tree,
    load_tree,
)

FOLDER = Path(__file__).resolve().parents[1] / "tests" / "engine" / "bench_trees"
TREES = ("wide100", "widemem100", "chain50", "mixed1000", "scripts100")
TARGETS = {"wide100": 0.25, "widemem100": 1.0, "chain50": 0.8, "mixed1000": 0.40, "scripts100": 1.3}
BATCH_SECONDS = 0.01


class Ok(SyncAction):
    INPUT_PORTS = {"val": PortInformation(str, False)}

    def on_tick(self) -> int:
        return SUCCESS


class Ko(SyncAction):
    def on_tick(self) -> int:
        return FAILURE


class Run1(StatefulAction):
    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return RUNNING

    def on_halted(self) -> None:
        pass


def ours_registry() -> NodeRegistry:
    registry = NodeRegistry()
    for cls in (Ok, Ko, Run1):
        registry.register(cls)
    return registry


def ours(path: Path, *, logged: bool) -> Callable[[], Any]:
    tree = load_tree(path, ours_registry())
    if logged:
        tree.subscribe(lambda changes: None)
    return tree.tick_exactly_once


def behaviortreepy(path: Path) -> Callable[[], Any] | None:
    try:
        import behaviortreepy as bt
    except ImportError:
        return None
    factory = bt.BehaviorTreeFactory()
    factory.register_simple_action("Ok", lambda node: bt.NodeStatus.SUCCESS)
    factory.register_simple_action("Ko", lambda node: bt.NodeStatus.FAILURE)
    running = bt.NodeStatus.RUNNING
    factory.register_simple_stateful_action("Run1", lambda node: running, lambda node: running, lambda node: None)
    tree = factory.create_tree_from_text(path.read_text())
    tick = tree.tick_exactly_once

    def run() -> Any:
        return tick()

    run.keep = (factory, tree)  # type: ignore[attr-defined]
    return run


class _NativeLeaf(py_trees.behaviour.Behaviour):
    def __init__(self, name: str, status: PyTreesStatus) -> None:
        super().__init__(name)
        self._result = status

    def update(self) -> PyTreesStatus:
        return self._result


_NATIVE_LEAVES = {"Ok": PyTreesStatus.SUCCESS, "Ko": PyTreesStatus.FAILURE, "Run1": PyTreesStatus.RUNNING}


def native(element: ElementTree.Element) -> py_trees.behaviour.Behaviour | None:
    """Return the tree in py_trees' own nodes, or None where it has no such node."""
    name = element.get("name", element.tag)
    if element.tag in _NATIVE_LEAVES:
        return _NativeLeaf(name, _NATIVE_LEAVES[element.tag])
    children = [native(child) for child in element]
    if any(child is None for child in children):
        return None
    found = [child for child in children if child is not None]
    if element.tag in ("Sequence", "ReactiveSequence"):
        return py_trees.composites.Sequence(name, memory=element.tag == "Sequence", children=found)
    if element.tag in ("Fallback", "ReactiveFallback"):
        return py_trees.composites.Selector(name, memory=element.tag == "Fallback", children=found)
    if element.tag == "Inverter":
        return py_trees.decorators.Inverter(name, found[0])
    return None


def native_tick(path: Path, *, visitor: bool) -> Callable[[], Any] | None:
    root = native(ElementTree.parse(path).getroot()[0][0])
    if root is None:
        return None
    if not visitor:
        return root.tick_once
    tree = py_trees.trees.BehaviourTree(root)
    tree.add_visitor(py_trees.visitors.SnapshotVisitor())
    return tree.tick


def measure(ticks: dict[str, Callable[[], Any] | None], rounds: int) -> dict[str, float | None]:
    """Return microseconds per call of each function; their batches alternate."""
    counts: dict[str, int] = {}
    best: dict[str, float | None] = dict.fromkeys(ticks)
    for name, tick in ticks.items():
        if tick is not None:
            for _ in range(20):
                tick()
            start = time.perf_counter()
            tick()
            once = max(time.perf_counter() - start, 2e-7)
            counts[name] = max(2, int(BATCH_SECONDS / once))
    for _ in range(rounds):
        for name, tick in ticks.items():
            if tick is None:
                continue
            count = range(counts[name])
            start = time.perf_counter()
            for _ in count:
                tick()
            taken = (time.perf_counter() - start) / len(count) * 1e6
            known = best[name]
            best[name] = taken if known is None else min(known, taken)
    return best


def load_text(nodes: int) -> str:
    """Return a file with about ``nodes`` nodes, a tenth of them with scripts, a fifth with ports."""
    blocks = "".join(
        f'<Sequence name="s{i}"><Inverter name="v{i}"><Ko name="k{i}"/></Inverter><Fallback name="f{i}">'
        f'<Ko name="q{i}" _skipIf="x{i} == 1"/><Ok name="o{i}" val="{{x{i}}}"/></Fallback>'
        f'<Repeat name="p{i}" num_cycles="3"><Ok name="w{i}" val="{i}"/></Repeat>'
        f'<Script name="c{i}" code="x{i} := {i} + 1"/></Sequence>\n'
        for i in range(round(nodes / 9))
    )
    tree = f'<BehaviorTree ID="M"><Sequence name="root">{blocks}</Sequence></BehaviorTree>'
    return f'<root BTCPP_format="4">{tree}</root>'


def measure_load(nodes: int, rounds: int) -> tuple[float, float]:
    """Return the best load time in milliseconds, and the bytes per node of a tree that is ready to tick."""
    text, registry = load_text(nodes), ours_registry()
    tree: Tree | None = None
    best = float("inf")
    for _ in range(rounds):
        tree = None
        gc.collect()
        start = time.perf_counter()
        tree = load_tree(text, registry)
        best = min(best, time.perf_counter() - start)
    tree = None
    gc.collect()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    tree = load_tree(text, registry)
    tree.halt()  # as the first tick would, this chooses what each node is called by
    gc.collect()
    used = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return best * 1e3, used / len(tree.nodes)


def run(trees: list[str], rounds: int) -> dict[str, Any]:
    results: dict[str, Any] = {}
    for name in trees:
        path = FOLDER / f"{name}.xml"
        ticks = {
            "ours_us": ours(path, logged=False),
            "ours_logged_us": ours(path, logged=True),
            "behaviortreepy_us": behaviortreepy(path),
            "py_trees_us": native_tick(path, visitor=False),
            "py_trees_visitor_us": native_tick(path, visitor=True),
        }
        results[name] = {key: None if v is None else round(v, 3) for key, v in measure(ticks, rounds).items()}
    results["load_1000_ms"] = round(measure_load(1000, 5)[0], 2)
    milliseconds, per_node = measure_load(10_000, 5)
    results["load_10000_ms"] = round(milliseconds, 2)
    results["bytes_per_node"] = round(per_node)
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=50)
    parser.add_argument("--trees", default=",".join(TREES))
    options = parser.parse_args()
    results = run(options.trees.split(","), options.rounds)
    if options.json:
        print(json.dumps(results))
        return
    titles = " ".join(f"{title:>9}" for title in ("ours", "logged", "btpy", "py_trees", "visitor"))
    print(f"{'tree':12} {titles} {'ratio':>7} {'wanted':>7}")
    for name in options.trees.split(","):
        row = results[name]
        peer = row["behaviortreepy_us"]
        ratio = f"{row['ours_us'] / peer:7.2f}" if peer else "      -"
        cells = " ".join(f"{value:9.2f}" if value is not None else f"{'-':>9}" for value in row.values())
        print(f"{name:12} {cells} {ratio} {TARGETS.get(name, 0):7.2f}")
    print({key: results[key] for key in ("load_1000_ms", "load_10000_ms", "bytes_per_node")})


if __name__ == "__main__":
    main()
