"""Mutated tree files: none may crash or hang `validate`, `convert`, `show`, `simulate` and `diff`.

    python benchmarks/foreign_trees.py --mutants 1000 [FOLDER…]      # by default the shipped trees

Each file is damaged as bytes (cut, doubled, swapped) or as XML (other names, values, elements moved), then checked,
drawn, simulated for 20 simulated seconds and compared with the undamaged one. Told are each that raised anything but an
error meant for users, or took longer than 5 s, and files per minute.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import time
import traceback
from pathlib import Path

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import EngineError, TreeLoadError, render_svg, render_text
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.models.conversion import convert
from bestman_bt.engine.models.difference import compare, difference_svg, differences
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.models.scenario import Scenario
from bestman_bt.engine.simulation import simulate
from bestman_bt.engine.validation import validate_file
from bestman_bt.engine.xml.documents import read_documents
from bestman_bt.runtime.plugins import node_registry

SLOW = 5.0
"""Seconds that a file may take."""
_WORDS = (
    *(
        "Sequence",
        "Fallback",
        "ReactiveSequence",
        "Inverter",
        "Repeat",
        "SubTree",
        "Script",
        "Switch2",
        "ForEach",
        "",
        "-1",
    ),
    *(
        "{x}",
        "{=}",
        "{@x}",
        "NaN",
        "1e999",
        "0",
        "true",
        "a;b",
        "x := x + 1",
        "x / 0",
        "&#0;",
        "\u202e",
        "Main",
        "_skipIf",
        "ID",
    ),
)


def mutate(data: bytes, generator: random.Random) -> bytes:
    """Return the file with one to four damages."""
    for _ in range(generator.randint(1, 4)):
        data = _damaged_bytes(data, generator) if generator.random() < 0.3 else _damaged_xml(data, generator)
    return data


def _damaged_bytes(data: bytes, generator: random.Random) -> bytes:
    start = generator.randrange(len(data) + 1)
    end = min(len(data), start + generator.randint(1, 40))
    part = data[start:end]
    replacement = generator.choice(
        [b"", part * 2, part[::-1], bytes(generator.randbytes(3)), b"<", b'"', b"\0", b"&x;"]
    )
    return data[:start] + replacement + data[end:]


def _damaged_xml(data: bytes, generator: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    pattern = generator.choice([r'"[^"]*"', r"<\w+", r"\s[\w:]+=", r"<[^<>]*/>", r"</\w+>"])
    found = list(re.finditer(pattern, text))
    if not found:
        return data
    match, word = generator.choice(found), generator.choice(_WORDS)
    other = generator.choice(found).group()
    made = {'"': f'"{word}"', "<": f"<{word}" if pattern == r"<\w+" else other}.get(match.group()[0], f" {word}=")
    return (
        text[: match.start()] + generator.choice([made, other, "", match.group() * 2]) + text[match.end() :]
    ).encode()


def fault_of(path: Path, registry: NodeRegistry, original: Path) -> str:
    """Check, convert, draw, simulate and compare a file; returns what it raised that users are not meant to see."""
    try:
        validate_file(path, registry, search_path=shipped_trees())
        try:
            convert(path.read_bytes(), str(path))
            tree = open_tree(path, registry, search_path=shipped_trees(), faults=[])
            render_text(tree)
            render_svg(tree)
            simulate(path, registry, scenario=Scenario(), limit=20.0, search_path=shipped_trees())
            compared = compare(read_documents(original, shipped_trees()), read_documents(path, shipped_trees()))
            differences(compared)
            difference_svg(compared, "damaged")
        except TreeLoadError:
            pass
    except EngineError as error:
        return f"{type(error).__name__}: {error}"
    except Exception:  # noqa: BLE001 - a crash of any kind is what the trial looks for
        return traceback.format_exc()
    return ""


def run(files: list[Path], mutants: int, seed: int, scratch: Path) -> list[str]:
    """Damage files in turn; returns a line for each that crashed or took longer than ``SLOW`` seconds."""
    registry, faults = node_registry(), []
    originals = {file: file.read_bytes() for file in files}
    for number in range(mutants):
        generator = random.Random(seed + number)
        file = files[number % len(files)]
        path = scratch / "mutant.xml"
        path.write_bytes(mutate(originals[file], generator))
        began = time.process_time()
        fault = fault_of(path, registry, file)
        if not fault and time.process_time() - began > SLOW:
            fault = f"took {time.process_time() - began:.1f} s of processor time"
        if fault:
            faults.append(f"{file}, seed {seed + number}: {fault}")
    return faults


def main() -> None:
    """Run the benchmark."""
    import tempfile

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--mutants", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    files = [file for folder in asked.folders or shipped_trees() for file in sorted(folder.rglob("*.xml"))]
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        faults = run(files, asked.mutants, asked.seed, Path(scratch))
    print(*faults, sep="\n")
    rate = 60 * asked.mutants / (time.monotonic() - began)
    print(f"{asked.mutants} mutants of {len(files)} files, {len(faults)} faults, {rate:.0f} a minute")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
