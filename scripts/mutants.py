"""Seed the faults of tests/mutants/*.yaml one at a time and see whether the tests find them.

    python scripts/mutants.py [--jobs 2] [--package NAME] [--only TEXT] [--quick] [--check] [--out runs/mutants]

Each fault names a function, text in it and what replaces it, so it survives a moved file. The tests that it names run
first, then those of its package, in a copy of the checkout. ``--quick`` leaves out the tests marked slow, as
``make test`` does; ``--check`` only verifies that every fault applies. Finished faults are kept in
``OUT/journal.jsonl`` until a file changes; ``OUT/summary.json`` holds the figures.

Exit codes: 0 every fault was found, 1 some survived, 2 a fault does not apply or its tests fail without it.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

import yaml

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGES = ("bestman_bt", "behaviours", "hal")
FIELDS = {"fault", "function", "before", "after", "tests", "package"}
PACKAGE_TESTS_LIMIT = 1800
"""Seconds that the tests of one package may take."""


class FaultError(Exception):
    """A fault that does not apply, or whose tests cannot run."""


@dataclass(frozen=True)
class Fault:
    """One seeded fault.

    ``function``: qualified name within its module; ``package``: the start of its module's name, if that is not unique.
    """

    origin: str
    fault: str
    function: str
    before: str
    after: str
    tests: tuple[str, ...]
    package: str = ""


@dataclass(frozen=True)
class Definition:
    """A function, class or module-level constant: its file and lines (counted from 0, end excluded)."""

    file: Path
    start: int
    end: int


@dataclass(frozen=True)
class Verdict:
    """``by``: the first test that failed, or ``""`` if the fault survived; ``stage``: named, package or none."""

    fault: str
    package: str
    by: str
    stage: str
    seconds: float


def load_faults(folder: Path) -> list[Fault]:
    """Read every fault. Raises FaultError with all entries that are malformed."""
    faults, problems = [], []
    for file in sorted(folder.glob("*.yaml")):
        for number, entry in enumerate(yaml.safe_load(file.read_text()) or [], 1):
            origin = f"{file.relative_to(CHECKOUT)} entry {number}"
            missing, unknown = FIELDS - {"package"} - set(entry), set(entry) - FIELDS
            if missing or unknown:
                problems.append(f"{origin}: missing {sorted(missing)}, unknown {sorted(unknown)}")
                continue
            faults.append(Fault(origin, **{**entry, "tests": tuple(entry["tests"])}))
    if problems:
        raise FaultError("\n".join(problems))
    return faults


def tracked_files() -> list[str]:
    """The files of the checkout that Git knows or would add."""
    listed = subprocess.check_output(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=CHECKOUT, text=True
    )
    return sorted({name for name in listed.splitlines() if (CHECKOUT / name).is_file()})


def index_definitions(files: Sequence[str]) -> dict[str, list[Definition]]:
    """Map each qualified name to its definitions in the import packages."""
    index: dict[str, list[Definition]] = defaultdict(list)
    for name in files:
        if name.endswith(".py") and name.split("/")[0] in PACKAGES:
            path = CHECKOUT / name
            for qualified, node in _definitions(ast.parse(path.read_text()), ""):
                first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
                index[qualified].append(Definition(Path(name), first - 1, node.end_lineno or node.lineno))
    return index


def _definitions(parent: ast.AST, prefix: str) -> Iterator[tuple[str, ast.stmt]]:
    for node in getattr(parent, "body", []):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield prefix + node.name, node
                yield from _definitions(node, f"{prefix}{node.name}.")
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)) if not prefix:
                yield name, node
            case ast.If() | ast.Try() | ast.With():
                yield from _definitions(node, prefix)


def apply(fault: Fault, index: dict[str, list[Definition]]) -> tuple[Path, str]:
    """Return the file of the fault and its text with the fault in it. Raises FaultError if it does not apply."""
    places = []
    prefix = fault.package.replace(".", "/")
    for definition in index.get(fault.function, []):
        if not str(definition.file.with_suffix("")).startswith(prefix):
            continue
        lines = (CHECKOUT / definition.file).read_text().splitlines(keepends=True)
        source = "".join(lines[definition.start : definition.end])
        dedented = textwrap.dedent(source)
        if dedented.count(fault.before) == 1:
            indent = source[: len(source.partition("\n")[0]) - len(dedented.partition("\n")[0])]
            changed = dedented.replace(fault.before, fault.after)
            new_lines = [*lines[: definition.start], textwrap.indent(changed, indent), *lines[definition.end :]]
            places.append((definition.file, changed, "".join(new_lines)))
    if len(places) != 1:
        raise FaultError(
            f"{fault.origin} ({fault.fault}): the text occurs exactly once in {len(places)} of the "
            f"{len(index.get(fault.function, []))} definitions of {fault.function!r}; exactly one is needed"
        )
    file, changed, text = places[0]
    try:
        ast.parse(changed)
    except SyntaxError as error:
        raise FaultError(f"{fault.origin} ({fault.fault}): the text after does not parse: {error}") from error
    return file, text


def check(faults: Sequence[Fault], index: dict[str, list[Definition]]) -> dict[str, tuple[Path, str]]:
    """Apply every fault in memory; returns file and text by origin. Raises FaultError with all that do not apply."""
    applied, problems = {}, []
    for fault in faults:
        problems.extend(
            f"{fault.origin} ({fault.fault}): there is no {test}"
            for test in fault.tests
            if not (CHECKOUT / test.split("::")[0]).exists()
        )
        try:
            applied[fault.origin] = apply(fault, index)
        except FaultError as error:
            problems.append(str(error))
    if problems:
        raise FaultError("\n".join(problems))
    return applied


def package_of(file: Path) -> str:
    """The package that a file is counted to: ``engine`` of bestman_bt, else ``behaviours`` or ``hal``."""
    return file.parts[1].removesuffix(".py") if file.parts[0] == "bestman_bt" else file.parts[0]


def package_tests(file: Path) -> str:
    """The folder of tests that mirrors a file: the deepest that exists."""
    parts = file.parts[1:-1] if file.parts[0] == "bestman_bt" else file.parts[:-1]
    while parts and not (CHECKOUT / "tests").joinpath(*parts).is_dir():
        parts = parts[:-1]
    return "/".join(("tests", *parts))


class Workplace:
    """A copy of the checkout in which faults are seeded and tests run."""

    def __init__(self, folder: Path, files: Sequence[str]) -> None:
        self._folder = folder
        self._edits = 0
        for name in files:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CHECKOUT / name, folder / name)
        packages = "bestman_bt/monitor/page/node_modules"
        if (CHECKOUT / packages).is_dir():
            (folder / packages).symlink_to(CHECKOUT / packages)

    def write(self, file: Path, text: str) -> None:
        """Replace a file, with a time of its own so that no stale byte code is taken for it."""
        path = self._folder / file
        path.write_text(text)
        self._edits += 1
        moment = time.time() + 10 * self._edits
        os.utime(path, (moment, moment))

    def restore(self, file: Path) -> None:
        """Undo ``write``."""
        self.write(file, (CHECKOUT / file).read_text())

    def run(self, tests: Sequence[str], quick: bool, limit: float) -> str:
        """Run tests until one fails; returns its name, or ``""`` if all passed. Raises FaultError if none ran."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--timeout=120", *tests]
        if quick:
            command += ["-m", "not slow"]
        environment = {**os.environ, "PYTHONPATH": str(self._folder)}
        try:
            done = subprocess.run(
                command, cwd=self._folder, env=environment, capture_output=True, text=True, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            return f"no end within {limit:g} s"
        match done.returncode:
            case 0:
                return ""
            case 1 | 2:
                named = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
                return named[1] if named else done.stdout.strip().splitlines()[-1]
            case 5 if quick:
                return ""
            case code:
                raise FaultError(f"pytest {' '.join(tests)} ended with {code}: {(done.stdout + done.stderr)[-800:]}")


def judge(fault: Fault, place: tuple[Path, str], workplace: Workplace, quick: bool) -> Verdict:
    """Seed one fault and run its tests, then its package's."""
    file, text = place
    started = time.monotonic()
    workplace.write(file, text)
    try:
        stage, by = "named", workplace.run(fault.tests, quick, PACKAGE_TESTS_LIMIT)
        if not by:
            stage, by = "package", workplace.run([package_tests(file)], quick, PACKAGE_TESTS_LIMIT)
    finally:
        workplace.restore(file)
    return Verdict(fault.fault, package_of(file), by, stage if by else "none", round(time.monotonic() - started, 1))


def fingerprint(files: Sequence[str], quick: bool) -> str:
    """A digest of every file that may decide whether a fault is found."""
    digest = hashlib.sha256(str(quick).encode())
    for name in files:
        if not name.startswith(("docs/", "tests/mutants/")) and not name.endswith(".md"):
            digest.update(name.encode() + (CHECKOUT / name).read_bytes())
    return digest.hexdigest()[:16]


def seed_all(
    faults: Sequence[Fault], applied: dict[str, tuple[Path, str]], files: Sequence[str], options: argparse.Namespace
) -> list[Verdict]:
    """Judge the faults that the journal does not hold yet, ``jobs`` at a time."""
    journal = options.out / "journal.jsonl"
    journal.parent.mkdir(parents=True, exist_ok=True)
    state, known = fingerprint(files, options.quick), {}
    for line in journal.read_text().splitlines() if journal.exists() else ():
        if (entry := json.loads(line)).pop("state") == state:
            key = entry.pop("key")
            known[key] = Verdict(**entry)
    keys = {fault: hashlib.sha256(repr(fault).encode()).hexdigest()[:16] for fault in faults}
    waiting = [fault for fault in faults if keys[fault] not in known]
    with tempfile.TemporaryDirectory(prefix="mutants-") as temporary:
        free: SimpleQueue[Workplace] = SimpleQueue()
        for number in range(options.jobs):
            free.put(Workplace(Path(temporary) / str(number), files))
        if waiting:
            named = sorted({test for fault in waiting for test in fault.tests})
            print(f"without any fault: {len(named)} files of tests …", flush=True)
            workplace = free.get()
            if failing := workplace.run(named, options.quick, 4 * PACKAGE_TESTS_LIMIT):
                raise FaultError(f"without any fault, this fails: {failing}")
            free.put(workplace)

        def work(fault: Fault) -> Verdict:
            workplace = free.get()
            try:
                return judge(fault, applied[fault.origin], workplace, options.quick)
            finally:
                free.put(workplace)

        with ThreadPoolExecutor(options.jobs) as pool:
            running = {pool.submit(work, fault): fault for fault in waiting}
            for number, future in enumerate(as_completed(running), 1):
                verdict, key = future.result(), keys[running[future]]
                known[key] = verdict
                with journal.open("a") as lines:
                    lines.write(json.dumps({"state": state, "key": key, **asdict(verdict)}) + "\n")
                result = f"found by {verdict.by}" if verdict.by else "SURVIVED"
                print(f"{number}/{len(waiting)} {verdict.package}: {verdict.fault}: {result}", flush=True)
    return [known[keys[fault]] for fault in faults]


def summarise(verdicts: Sequence[Verdict], quick: bool) -> dict[str, object]:
    """Found and survived per package, with what ran it."""
    found = Counter(verdict.package for verdict in verdicts if verdict.by)
    total = Counter(verdict.package for verdict in verdicts)
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    return {
        "commit": commit.stdout.strip(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "tests": "quick" if quick else "all",
        "found": sum(found.values()),
        "of": len(verdicts),
        "packages": {name: {"found": found[name], "of": total[name]} for name in sorted(total)},
        "survived": [verdict.fault for verdict in verdicts if not verdict.by],
        "found_by_package_tests_only": [verdict.fault for verdict in verdicts if verdict.stage == "package"],
        "seconds": round(sum(verdict.seconds for verdict in verdicts), 1),
    }


def main() -> int:
    """Read the arguments, seed the faults, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--package", help="only the faults of one package: engine, behaviours, hal, …")
    parser.add_argument("--only", help="only the faults whose sentence or file has this text")
    parser.add_argument("--quick", action="store_true", help="leave out the tests marked slow")
    parser.add_argument("--check", action="store_true", help="only verify that every fault applies")
    parser.add_argument("--out", type=Path, default=CHECKOUT / "runs" / "mutants")
    options = parser.parse_args()
    try:
        faults, files = load_faults(CHECKOUT / "tests" / "mutants"), tracked_files()
        applied = check(faults, index_definitions(files))
        if options.package:
            faults = [fault for fault in faults if package_of(applied[fault.origin][0]) == options.package]
        if options.only:
            faults = [fault for fault in faults if options.only in f"{fault.origin} {fault.fault}"]
        print(f"{len(faults)} faults, all of which apply", flush=True)
        if options.check:
            return 0
        summary = summarise(seed_all(faults, applied, files, options), options.quick)
    except FaultError as error:
        print(error, file=sys.stderr)
        return 2
    (options.out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    print(json.dumps(summary, indent=2))
    return 0 if summary["found"] == summary["of"] else 1


if __name__ == "__main__":
    sys.exit(main())
