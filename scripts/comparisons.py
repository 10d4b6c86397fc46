"""Measure the tables of docs/comparisons.md at the current commit; `make comparisons` runs all of them.

Each command's JSON is kept in docs/reproductions, without its single problems, with commit, machine and versions.

.venv/bin/python scripts/comparisons.py engine planning_domains --data ../data
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bestman_bt.evaluation.versions import versions

ROOT = Path(__file__).parents[1]
PAGE, FOLDER = ROOT / "docs" / "comparisons.md", ROOT / "docs" / "reproductions"
SINGLE = ("problems", "episodes", "left_out", "unsolved", "touching", "families")
"""Keys of JSON documents that list single problems."""
END = "<!-- end -->"
Document = dict[str, Any]
Rows = Iterable[Iterable[object]]


@dataclass(frozen=True)
class Comparison:
    """A table. ``commands``: name → arguments, in which ``DATA`` is the folder of the data. ``head``: its columns."""

    commands: dict[str, str]
    head: tuple[str, ...]
    rows: Callable[[dict[str, Document]], Rows]


def _rounded(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"


def _engine(found: dict[str, Document]) -> Rows:
    for tree, row in found["engine"].items():
        if isinstance(row, dict):
            yield tree, *(_rounded(value) for value in row.values())


def _kitchen(found: dict[str, Document]) -> Rows:
    one = found["kitchen_planning"]
    ratio, solved = one["length_ratio"], one["fast_downward_solves"]
    yield "solved", f"{one['symbolic_solves_of_these']} of these", f"{solved} of {one['problems']}"
    yield "plans that unified-planning's validator accepts", f"{one['plans_valid']} of {one['plans']}", "-"
    yield (
        "actions, relative to Fast Downward's plan",
        f"median {ratio['median']:.2f}, at most {ratio['largest']:.2f}",
        "1",
    )
    times = one["symbolic_wall_seconds"], one["fast_downward_wall_seconds"]
    yield "wall time, median / largest, s", *(f"{each['median']:.2f} / {each['largest']:.2f}" for each in times)


def _planners(found: dict[str, Document]) -> Rows:
    for row in next(iter(found.values()))["table"]:
        cells = []
        for name in ("symbolic", "fast_downward", "pyperplan"):
            one = row.get(name)
            if one is None or not one["solved"]:
                cells.append("-" if one is None else f"0 ({', '.join(one['results'])})")
                continue
            seconds, length = one["seconds"], "-" if one["length"] is None else f"{one['length']:g}"
            cells.append(f"{one['solved']}; {length}; {seconds['median']} / {seconds['largest']} s")
        yield row["group"], row["problems"], *cells


def _workshop(found: dict[str, Document]) -> Rows:
    for problem in range(1, 5):
        pair = [found[f"roscon24_{problem}{kind}"] for kind in ("", "_planned")]
        yield (
            problem,
            *(
                f"{one['succeeded']} of {one['of']}; {one['actions_median']:g}; {one['battery_median']:g} %"
                for one in pair
            ),
        )


def _motions(found: dict[str, Document]) -> Rows:
    for robot, one in found.items():
        for planner, row in one["planners"].items():
            times = row["plan_ms"] or {"median": "-", "p95": "-"}
            cells = row["solved"], row["strictly_free"], times["median"], times["p95"], row["cost_ratio"] or "-"
            yield robot.removeprefix("motion_"), planner, row["problems"], *cells


def _engines(found: dict[str, Document]) -> Rows:
    for task, by_engine in found["physics_engines"]["tasks"].items():
        for engine, one in by_engine.items():
            successes = f"{one['successes']} of {len(one['seeds'])}"
            yield task, engine, successes, one["clean_audits"], f"{one['cpu_time_factor']:.1f}", f"{one['cpu_s']:.1f}"


MOTIONS = "benchmarks/motion_bench_maker.py --json --robot"
WORKSHOP = "examples/roscon24/run.py --json --data DATA/roscon24 --seeds 50 --problem"
EAI = "eai_eval-1.0.5-py3-none-any.whl"
PLANNERS = ("", "problems", "`symbolic`", "Fast Downward", "pyperplan")
COMPARISONS = {
    "engine": Comparison(
        {"engine": "benchmarks/engine.py --json"},
        ("tree", "here", "here, logged", "behaviortreepy", "py_trees", "py_trees with SnapshotVisitor"),
        _engine,
    ),
    "kitchen_planning": Comparison(
        {"kitchen_planning": "benchmarks/task_planning.py --first-seed 7000 --problems 200"},
        ("", "`symbolic`", "Fast Downward"),
        _kitchen,
    ),
    "planning_domains": Comparison(
        {"planning_domains": "benchmarks/competition_domains.py --json --first-seed 500 --seeds 5"}, PLANNERS, _planners
    ),
    "embodied_agent_interface": Comparison(
        {"embodied_agent_interface": f"benchmarks/competition_domains.py --json --eai DATA/{EAI}"},
        PLANNERS,
        _planners,
    ),
    "roscon24": Comparison(
        {
            f"roscon24_{problem}{kind}": f"{WORKSHOP} {problem}{option}"
            for problem in range(1, 5)
            for kind, option in (("", ""), ("_planned", " --planned"))
        },
        ("problem", "the workshop's tree, unchanged", "tree planned from the goal"),
        _workshop,
    ),
    "motions": Comparison(
        {"motion_panda": f"{MOTIONS} panda --every 10 --archive DATA/motion_bench_maker/panda.tar.bz2"},
        ("robot", "planner", "problems", "solved", "strictly free", "median, ms", "p95, ms", "cost"),
        _motions,
    ),
    "physics_engines": Comparison(
        {"physics_engines": "-m benchmarks.engines --json"},
        ("task", "engine", "success", "clean audits", "simulated / processor time", "processor time, s"),
        _engines,
    ),
}


def _without_single_problems(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {
        key: _without_single_problems(inner)
        for key, inner in value.items()
        if key not in SINGLE or not isinstance(inner, (list, dict))
    }


def measured(name: str, arguments: str, data: Path, commit: str) -> Document | None:
    """Run a command and keep its document; None, with the reason on the standard error, if it fails."""
    command = [sys.executable, *(word.replace("DATA", str(data)) for word in arguments.split())]
    print(f"{name}: python {arguments}", file=sys.stderr, flush=True)
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        print(f"{name}: failed with exit code {done.returncode}", file=sys.stderr)
        return None
    document: Document = json.loads(done.stdout)
    machine = {"platform": platform.platform(), "cores": os.cpu_count(), "load": round(os.getloadavg()[0], 2)}
    about = {"commit": commit, "command": f"python {arguments}", "machine": machine, "versions": versions()}
    kept = {**_without_single_problems(document), **about}
    (FOLDER / f"{name}.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    return document


def with_table(page: str, name: str, comparison: Comparison, found: dict[str, Document], commit: str) -> str:
    """Return the page with the table and its commit between the two marks of that name."""
    lines = [comparison.head, ["---"] * len(comparison.head), *comparison.rows(found)]
    table = "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
    mark = f"<!-- scripts/comparisons.py: {name} -->"
    block = f"{mark}\n\n{table}\n\nCommit {commit}.\n\n{END}"
    text, count = re.subn(rf"{re.escape(mark)}\n(?:(?!<!-- ).)*{END}", lambda _: block, page, flags=re.DOTALL)
    if count != 1:
        raise ValueError(f"{PAGE} should have {mark} once, and has it {count} times")
    return text


def main() -> int:
    """Measure the tables that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="TABLE", help=f"{', '.join(COMPARISONS)}; default: all")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path("build/comparisons"),
        help="folder with motion_bench_maker/, roscon24/ and the wheel eai-eval",
    )
    asked = parser.parse_args()
    if unknown := [name for name in asked.names if name not in COMPARISONS]:
        parser.error(f"{', '.join(unknown)}: should be of {', '.join(COMPARISONS)}")
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--exclude=*"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()
    data = asked.data.resolve()
    FOLDER.mkdir(exist_ok=True)
    failed = False
    for name in asked.names or COMPARISONS:
        comparison = COMPARISONS[name]
        words = [word for line in comparison.commands.values() for word in line.split() if word.startswith("DATA")]
        missing = [path for path in (word.replace("DATA", str(data)) for word in words) if not Path(path).exists()]
        if missing:
            print(f"{name}: left out, there is no {', '.join(dict.fromkeys(missing))}", file=sys.stderr)
            continue
        found = {each: measured(each, line, data, commit) for each, line in comparison.commands.items()}
        whole = {each: document for each, document in found.items() if document is not None}
        failed |= len(whole) < len(found)
        if len(whole) == len(found):
            page = PAGE.read_text(encoding="utf-8")
            PAGE.write_text(with_table(page, name, comparison, whole, commit), encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
