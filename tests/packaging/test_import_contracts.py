"""The import contracts cover the whole tree, and each of them can fail."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SETTINGS = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["importlinter"]
CONTRACTS = {contract["id"]: contract for contract in SETTINGS["contracts"]}

FORBIDDEN_IMPORTS = [
    ("bestman_bt/perception", "import hal.api", "pure"),
    ("bestman_bt/navigation", "import pybullet", "pure"),
    ("bestman_bt/manipulation", "import bestman_bt.engine", "pure"),
    ("bestman_bt/manipulation", "import bestman_bt.perception", "floors"),
    ("bestman_bt/perception", "import bestman_bt.scene", "algorithms"),
    ("bestman_bt/engine", "import bestman_bt.messages", "nothing"),
    ("bestman_bt/messages", "import behaviours", "floors"),
    ("bestman_bt/world_model", "import bestman_bt.configuration", "models"),
    ("bestman_bt/scene", "import bestman_bt.robot_model", "scenes"),
    ("bestman_bt/robot_model", "import bestman_bt.world_model", "robots"),
    ("hal/api", "import bestman_bt.scene", "models"),
    ("bestman_bt/visualization", "import bestman_bt.robot_model", "viewers"),
    ("bestman_bt/control", "import bestman_bt.engine", "control"),
    ("bestman_bt/control", "import hal.pybullet", "control"),
    ("hal/pybullet", "import bestman_bt.world_model", "drivers"),
    ("hal/simulation", "import hal.pybullet", "floors"),
    ("behaviours", "import hal.api", "skills"),
    ("behaviours", "import bestman_bt.evaluation", "floors"),
]


def packages() -> set[str]:
    """Dotted names of the packages and modules one level below ours, and of behaviours."""
    found = {"behaviours"}
    for top in ("bestman_bt", "hal"):
        for path in (CHECKOUT / top).iterdir():
            if (path / "__init__.py").exists() or (path.suffix == ".py" and path.stem != "__init__"):
                found.add(f"{top}.{path.stem}")
    return found


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What import-linter says of each contract, by its name, in a copy of the tree with every forbidden import."""
    tree = tmp_path_factory.mktemp("tree")
    for name in ("bestman_bt", "behaviours", "hal"):
        shutil.copytree(CHECKOUT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(CHECKOUT / "pyproject.toml", tree)
    for number, (folder, statement, _) in enumerate(FORBIDDEN_IMPORTS):
        (tree / folder / f"trespasser_{number}.py").write_text(f"{statement}\n")
    (tree / "behaviours/perception/trespasser.py").write_text("import behaviours.manipulation\n")
    command = [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"]
    wide = {**os.environ, "COLUMNS": "400"}
    output = subprocess.run(command, cwd=tree, env=wide, capture_output=True, text=True, check=False).stdout
    parts = re.split(r"^(\S.+)\n-{3,}\n", output.partition("Broken contracts")[2], flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_package_stands_on_a_floor() -> None:
    floors = {re.sub(r"[()\s]", "", name) for floor in CONTRACTS["floors"]["layers"] for name in floor.split("|")}
    assert packages() - floors == set()


def test_every_package_below_the_command_line_has_an_allow_list_or_stands_above_all() -> None:
    above = {"bestman_bt.api", "bestman_bt.bringup", "bestman_bt.cli", "bestman_bt.testing"}
    free = above | {"bestman_bt.evaluation", "bestman_bt.runtime"}
    listed = {source for contract in CONTRACTS.values() for source in contract.get("source_modules", [])}
    assert packages() - listed - free == set()


@pytest.mark.slow
def test_the_page_shows_what_the_contracts_allow() -> None:
    script = runpy.run_path(str(CHECKOUT / "scripts" / "import_table.py"))
    assert script["PAGE"].read_text() == script["table"](), "run scripts/import_table.py"


@pytest.mark.parametrize(("number", "case"), list(enumerate(FORBIDDEN_IMPORTS)))
def test_a_forbidden_import_breaks_its_contract(
    report: dict[str, str], number: int, case: tuple[str, str, str]
) -> None:
    folder, statement, contract = case
    offence = f"{folder.replace('/', '.')}.trespasser_{number} -> {statement.removeprefix('import ')} (l.1)"
    assert offence in report[CONTRACTS[contract]["name"]]


def test_packages_that_import_each_other_break_their_contract(report: dict[str, str]) -> None:
    assert "No cycles are allowed in behaviours." in report[CONTRACTS["circles"]["name"]]
