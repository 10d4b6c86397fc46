"""Runs recorded conformance cases against the engine and compares the traces at four levels.

    python tests/engine/conformance.py DIR... [--mode MODE] [--json]

The format of the cases is described in ``cases/README.md``. L1: returned statuses and errors; L2: leaf and echo
events; L3: blackboards; L4: every status transition. Exit code 0 only if every case passes at the level that its
tags ask for, but for the deviations that ``docs/deviations.md`` names.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
if str(REPOSITORY) not in sys.path:
    sys.path.insert(0, str(REPOSITORY))

from py_trees.visitors import SnapshotVisitor  # noqa: E402

from bestman_bt.engine import (  # noqa: E402
    FAILURE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    Blackboard,
    Condition,
    EngineError,
    ManualClock,
    NodeRegistry,
    PortInformation,
    StateChanges,
    StatefulAction,
    SyncAction,
    Tree,
    load_tree,
    status_name,
)
from bestman_bt.engine.conversion import text_of_number  # noqa: E402
from bestman_bt.engine.substitution import SubstitutionRules  # noqa: E402

MODES = ("logged", "plain", "visited", "hooked", "switching")
LETTERS = {"R": RUNNING, "S": SUCCESS, "F": FAILURE, "K": SKIPPED}
DEVIATIONS_PAGE = REPOSITORY / "docs" / "deviations.md"
MAX_TICKS = 20

_PLAN_PORTS = {
    "plan": PortInformation(str, False, "what to return", "S"),
    "value": PortInformation(str, False, "written to out on success"),
}
_OUT_PORTS = {"out": PortInformation(str, False)}


class _Recorded:
    """Mixin: events go to the tree's log while somebody listens, so that they keep their order, else to the context."""

    def emit(self, *event: Any) -> None:
        sink = self.log if self.log is not None else self.context
        sink.append([*event])

    def finish(self, status: int) -> int:
        if status == SUCCESS:
            value = self.get_input("value")
            if value is not None:
                self.set_output("out", value)
        return status


class Act(_Recorded, StatefulAction):
    INPUT_PORTS = _PLAN_PORTS
    OUTPUT_PORTS = _OUT_PORTS

    def on_load(self) -> None:
        self.rounds = 0

    def _letter(self) -> int:
        plan = self.round
        letter = plan[min(self.step, len(plan) - 1)]
        self.step += 1
        return self.finish(LETTERS[letter])

    def on_start(self) -> int:
        self.emit("leaf", "start", self.path)
        plans = self.get_input("plan").split("|")
        self.round = plans[min(self.rounds, len(plans) - 1)]
        self.rounds += 1
        self.step = 0
        return self._letter()

    def on_running(self) -> int:
        self.emit("leaf", "running", self.path)
        return self._letter()

    def on_halted(self) -> None:
        self.emit("leaf", "halted", self.path)


class _Lettered(_Recorded):
    INPUT_PORTS = _PLAN_PORTS
    OUTPUT_PORTS = _OUT_PORTS

    def on_load(self) -> None:
        self.step = 0

    def on_tick(self) -> int:
        self.emit("leaf", "tick", self.path)
        plan = self.get_input("plan")
        letter = plan[min(self.step, len(plan) - 1)]
        self.step += 1
        return self.finish(LETTERS[letter])


class Cond(_Lettered, Condition):
    pass


class Sync(_Lettered, SyncAction):
    pass


class Echo(_Recorded, SyncAction):
    INPUT_PORTS = {"in": PortInformation(Any, False)}

    def on_tick(self) -> int:
        value = self.get_input("in")
        if isinstance(value, (int, float)):
            value = text_of_number(value)
        self.emit("echo", self.path, value)
        return FAILURE if value is None else SUCCESS


class SetInt(_Recorded, SyncAction):
    INPUT_PORTS = {"value": PortInformation(int, False)}
    OUTPUT_PORTS = {"out": PortInformation(int, False)}

    def on_tick(self) -> int:
        self.emit("leaf", "tick", self.path)
        value = self.get_input("value")
        if value is None:
            raise self.error("port 'value' is not readable")
        self.set_output("out", value)
        return SUCCESS


class AddInt(_Recorded, SyncAction):
    INPUT_PORTS = {"a": PortInformation(int, False), "b": PortInformation(int, True, "", 1)}
    OUTPUT_PORTS = {"sum": PortInformation(int, False)}

    def on_tick(self) -> int:
        self.emit("leaf", "tick", self.path)
        try:
            a = self.get_input("a")
        except EngineError:
            return FAILURE
        if a is None:
            return FAILURE
        self.set_output("sum", a + self.get_input("b"))
        return SUCCESS


def registry_of_cases(enums: dict[str, int] | None = None) -> NodeRegistry:
    """Return a registry with the leaves that the cases use."""
    registry = NodeRegistry()
    for cls in (Act, Cond, Sync, Echo, SetInt, AddInt):
        registry.register(cls)
    for name, value in (enums or {}).items():
        registry.register_enum(name, value)
    return registry


@dataclass
class Run:
    """One case being run in one mode."""

    case: dict[str, Any]
    mode: str
    events: list[Any] = field(default_factory=list)
    states: dict[int, str] = field(default_factory=dict)

    def load(self) -> Tree:
        case = self.case
        self.clock = ManualClock()
        registry = registry_of_cases(case.get("enums"))
        external = case.get("external_blackboard")
        board = None
        if external:
            above = Blackboard("external", converters=registry.converters)
            for key, value in external.items():
                above.set(key, value)
            board = Blackboard("Main", above, converters=registry.converters)
        rules = case.get("substitutions")
        self.tree = load_tree(
            case["xml"],
            registry,
            context=self.events,
            clock=self.clock,
            blackboard=board,
            substitutions=SubstitutionRules.from_json(rules) if rules else None,
        )
        self.attach(0)
        return self.tree

    def attach(self, step: int) -> None:
        """Attach what the mode asks for; ``switching`` attaches and detaches a listener at every other step."""
        tree = self.tree
        if step == 0 and self.mode == "logged":
            tree.subscribe(self.listen)
        if step == 0 and self.mode == "visited":
            tree.add_visitor(SnapshotVisitor())
        if step == 0 and self.mode == "hooked":
            for node in tree.nodes:
                node.add_pre_tick(lambda node: None)
                node.add_post_tick(lambda node, status: None)
            tree.subscribe(self.listen)
        if self.mode == "switching":
            if step % 4 == 0:
                tree.subscribe(self.listen)
            elif step % 4 == 1:
                tree.unsubscribe(self.listen)
            elif step % 4 == 2:
                self.visitor = SnapshotVisitor()
                tree.add_visitor(self.visitor)
            else:
                tree.remove_visitor(self.visitor)

    def listen(self, changes: StateChanges) -> None:
        for code in changes.codes:
            if isinstance(code, list):
                self.events.append(code)
                continue
            uid, state = divmod(code, 8)
            name = status_name(state)
            self.events.append(["status", self.tree.nodes[uid - 1].path, self.states.get(uid, "IDLE"), name])
            self.states[uid] = name

    def steps(self) -> Iterator[dict[str, Any]]:
        """Do the steps of the case and yield what each gave."""
        steps = self.case.get("steps")
        for count, step in enumerate(steps if steps is not None else [{"op": "tick"}] * MAX_TICKS):
            if count:
                self.attach(count)
            self.events.clear()
            result: dict[str, Any] = {"op": step["op"]}
            try:
                returned = self.do(step)
                if returned is not None:
                    result["returned"] = status_name(returned)
            except EngineError as error:
                result["error"] = str(error)
            result["events"] = [list(event) for event in self.events]
            result["blackboard"] = {
                path or self.tree.tree_id: {k: v for k, v in board.items() if v is not None}
                for path, board in self.tree.blackboards.items()
            }
            result["status_after"] = {node.path: status_name(node.state) for node in self.tree.nodes}
            yield result
            if "error" in result:
                return  # so do the recordings
            if steps is None and result.get("returned") != "RUNNING":
                return

    def do(self, step: dict[str, Any]) -> int | None:
        op = step["op"]
        if op == "tick":
            return self.tree.tick_exactly_once()
        if op == "tick_once":
            return self.tree.tick_once()
        if op == "halt":
            self.tree.halt()
        elif op == "set":
            self.tree.blackboard.set(step["key"], step["value"])
        elif op == "sleep":
            self.clock.advance(step["ms"] * 1e-3)
        else:
            raise ValueError(f"unknown op {op!r}")
        return None


@dataclass(frozen=True)
class Outcome:
    """How far a case came: the levels that agree, and the first thing that does not."""

    case_id: str
    levels: frozenset[int]
    required: int
    why: str
    failed_level: int

    @property
    def passed(self) -> bool:
        return all(level in self.levels for level in range(1, self.required + 1))


def run_case(case: dict[str, Any], mode: str = "logged") -> Outcome:
    """Run one case and compare."""
    expected = case["expected"]
    required = 1 if "async_timer" in case.get("tags", ()) else 4
    run = Run(case, mode)
    try:
        tree = run.load()
    except EngineError as error:
        if "load_error" in expected:
            return Outcome(case["id"], frozenset((1, 2, 3, 4)), 1, "", 0)
        return Outcome(case["id"], frozenset(), required, f"does not load: {error}", 1)
    if "load_error" in expected:
        return Outcome(case["id"], frozenset(), 1, f"loads, but must fail with: {expected['load_error']}", 1)
    differences: dict[int, str] = {}
    nodes = sorted((node["uid"], node["path"]) for node in expected["nodes"])
    if nodes != [(node.uid, node.path) for node in tree.nodes]:
        differences[1] = f"nodes differ: {[(node.uid, node.path) for node in tree.nodes]}"
    actual = list(run.steps())
    if len(actual) != len(expected["steps"]):
        differences.setdefault(1, f"{len(actual)} steps instead of {len(expected['steps'])}")
    for index, (got, want) in enumerate(zip(actual, expected["steps"], strict=False)):
        for level, difference in compare_step(got, want, mode):
            differences.setdefault(level, f"step {index} ({got['op']}): {difference}")
    levels = frozenset(level for level in (1, 2, 3, 4) if level not in differences)
    first = min(differences, default=0)
    return Outcome(case["id"], levels, required, differences.get(first, ""), first)


def compare_step(got: dict[str, Any], want: dict[str, Any], mode: str) -> Iterator[tuple[int, str]]:
    """Yield each level at which a step differs, and how."""
    if ("error" in got) != ("error" in want) or got.get("returned") != want.get("returned"):
        yield 1, f"{got.get('returned') or got.get('error')} instead of {want.get('returned') or want.get('error')}"

    def leaves(events: list[Any]) -> list[Any]:
        return [event for event in events if event[0] != "status"]

    if leaves(got["events"]) != leaves(want["events"]):
        yield 2, f"leaf events {leaves(got['events'])} instead of {leaves(want['events'])}"
    if "blackboard" in want:
        boards = {p: {k: v for k, v in b.items() if v is not None} for p, b in want["blackboard"].items()}
        if boards != got["blackboard"]:
            yield 3, f"blackboard {got['blackboard']} instead of {boards}"
    if mode in ("logged", "hooked") and got["events"] != want["events"]:
        yield 4, f"events {got['events']} instead of {want['events']}"
    if "status_after" in want and got["status_after"] != want["status_after"]:
        yield 4, f"states {got['status_after']} instead of {want['status_after']}"


def read_cases(folders: list[Path]) -> list[dict[str, Any]]:
    """Return the cases in the folders, their subfolders included, or in single files."""
    files: list[Path] = []
    for folder in folders:
        files.extend(sorted(folder.rglob("*.json")) if folder.is_dir() else [folder])
    return [json.loads(file.read_text()) for file in files]


def named_deviations() -> set[str]:
    """Return the ids of the cases that the docs page of deviations names."""
    if not DEVIATIONS_PAGE.exists():
        return set()
    return set(re.findall(r"`(?:case:)?([a-z]\d+_\w+|x_\w+)`", DEVIATIONS_PAGE.read_text()))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--mode", choices=MODES, default="logged")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    outcomes = [run_case(case, options.mode) for case in read_cases(options.folders)]
    deviations = named_deviations()
    failed = [
        {"id": o.case_id, "level": o.failed_level, "why": o.why, "deviation": o.case_id in deviations}
        for o in outcomes
        if not o.passed
    ]
    summary: dict[str, Any] = {"cases": len(outcomes)}
    summary.update({f"L{level}": sum(level in o.levels for o in outcomes) for level in (1, 2, 3, 4)})
    summary["failed"] = failed
    if options.json:
        sys.stdout.write(json.dumps(summary) + "\n")
    else:
        sys.stdout.write(f"{summary['cases']} cases: " + ", ".join(f"L{n} {summary[f'L{n}']}" for n in (1, 2, 3, 4)))
        sys.stdout.write("\n")
        for failure in failed:
            note = " (named in docs/deviations.md)" if failure["deviation"] else ""
            sys.stdout.write(f"{failure['id']} fails at L{failure['level']}{note}: {failure['why']}\n")
    return 0 if all(failure["deviation"] for failure in failed) else 1


if __name__ == "__main__":
    sys.exit(main())
