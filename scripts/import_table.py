"""Write the column "may import" of docs/architecture.md from the import contracts in pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
PAGE = CHECKOUT / "docs" / "architecture.md"
ERRORS = "bestman_bt.errors"


def contracts() -> list[dict[str, Any]]:
    """Return the contracts of import-linter."""
    settings = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = settings["tool"]["importlinter"]["contracts"]
    return found


def floors() -> list[str]:
    """Return the packages of the floors, from the top."""
    layers = next(contract["layers"] for contract in contracts() if contract["id"] == "floors")
    return [re.sub(r"[()\s]", "", name) for floor in layers for name in floor.split("|")]


def may_import(packages: list[str]) -> str:
    """Return what packages may import besides errors, by their allow-lists, from the top floor down.

    Raises ValueError if they may import different things.
    """
    found = {_allowed(package) for package in packages}
    if len({names for names, _ in found}) > 1:
        raise ValueError(f"{', '.join(packages)} may import different things: write them in rows of their own")
    return "; ".join([next(iter(found))[0], *sorted(more for _, more in found if more)])


def _allowed(package: str) -> tuple[str, str]:
    """What a package may import, and what single files of it may import besides, in words."""
    order = floors()
    forbidden: set[str] = set()
    for contract in contracts():
        if package not in contract.get("source_modules", ()):
            continue
        if "ignore_imports" not in contract:
            forbidden |= {*contract["forbidden_modules"]} & {"hal", *order}
            continue
        pairs = [tuple(part.strip() for part in line.split("->")) for line in contract["ignore_imports"]]
        of_all = {target.removesuffix(".**") for source, target in pairs if source in ("**", f"{package}.**")}
        below = order[order.index(package) + 1 :]
        names = [_short(name) for name in below if name in of_all - {package, ERRORS}]
        one_file = [
            f"`{source.rpartition('.')[2]}` alone: {_short(target)}"
            for source, target in pairs
            if source.startswith(f"{package}.") and "*" not in source + target
        ]
        return ", ".join(names) or "nothing", ", ".join(one_file)
    if forbidden:
        return f"everything below but {', '.join(_short(name) for name in sorted(forbidden))}", ""
    return "nothing" if package == ERRORS else "everything below", ""


def _short(name: str) -> str:
    return f"`{name}`" if name.startswith("hal") else name.removeprefix("bestman_bt.")


def table() -> str:
    """Return the page with the column made anew. Raises ValueError for a package without a row."""
    named, lines = set(), PAGE.read_text(encoding="utf-8").splitlines(keepends=True)
    for number, line in enumerate(lines):
        cells = line.strip().strip("|").split(" | ")
        packages = [
            path.removesuffix(".py").strip("/").replace("/", ".") for path in re.findall(r"`([^`]+)`", cells[0])
        ]
        if len(cells) == 3 and packages and set(packages) <= set(floors()):
            named |= set(packages)
            lines[number] = f"| {cells[0].strip()} | {cells[1]} | {may_import(packages)} |\n"
    if missing := set(floors()) - named:
        raise ValueError(f"{PAGE.name} has no row for {', '.join(sorted(missing))}")
    return "".join(lines)


if __name__ == "__main__":
    PAGE.write_text(table(), encoding="utf-8")
