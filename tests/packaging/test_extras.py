"""Without the packages of the extras: what needs none works, and what needs one names it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from bestman_bt.extras import PACKAGE_OF_EXTRA, PYBULLET_HAS_WHEELS

CHECKOUT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
CORE = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["dependencies"]

ABSENT = (
    "mujoco",
    "pybullet",
    "rerun",
    "rerun_cli",
    "pyarrow",
    "coacd",
    "open3d",
    "fast_simplification",
    "onnxruntime",
    "onnx",
    "msgpack",
    "ray",
    "submitit",
    "av",
)
WORKS = (
    ["--help"],
    ["version"],
    ["nodes"],
    ["show", "fetch_cup"],
    ["validate", "fetch_cup"],
    ["robots"],
    ["domain"],
)
SIMULATOR = ("pybullet", "sim") if PYBULLET_HAS_WHEELS else ("mujoco", "mujoco")
"""Package and extra of the simulator that runs by default."""
REFUSED = {
    ("run", "fetch_cup"): SIMULATOR,
    ("run", "fetch_cup", "--driver", "mujoco"): ("mujoco", "mujoco"),
    ("run", "fetch_cup", "--record"): ("rerun", "rerun"),
    ("run", "fetch_cup", "--live"): SIMULATOR,
    ("look", "--clouds"): ("open3d", "open3d"),
    ("demo",): SIMULATOR,
    ("robot", "check", "diff_panda"): SIMULATOR,
}
PROGRAM = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))
from bestman_bt.cli.main import main
results = []
for arguments in json.loads(sys.argv[2]):
    sys.argv = ["bestman-bt", *arguments]
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    results.append([code, out.getvalue(), err.getvalue()])
print(json.dumps(results))
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, ...], tuple[int, str, str]]:
    """Exit code, output and errors of each command where none of the packages ``ABSENT`` can be imported."""
    commands = [list(command) for command in (*WORKS, *REFUSED)]
    arguments = [sys.executable, "-c", PROGRAM, json.dumps(ABSENT), json.dumps(commands)]
    folder = tmp_path_factory.mktemp("without_extras")
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not list(folder.iterdir()), "a refused run left something"
    answers = json.loads(done.stdout.splitlines()[-1])
    return {tuple(command): tuple(answer) for command, answer in zip(commands, answers, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("command", WORKS, ids=" ".join)
def test_a_command_that_starts_no_robot_needs_no_extra(
    results: dict[tuple[str, ...], tuple[int, str, str]], command: list[str]
) -> None:
    code, output, errors = results[tuple(command)]
    assert code == 0, errors
    assert output


@pytest.mark.parametrize("command", REFUSED, ids=" ".join)
def test_a_command_whose_extra_is_missing_starts_nothing_and_names_it(
    results: dict[tuple[str, ...], tuple[int, str, str]], command: tuple[str, ...]
) -> None:
    code, output, errors = results[command]
    package, extra = REFUSED[command]
    assert code == 2
    assert output == ""
    assert "nothing was started" in errors
    assert re.search(rf"needs the package '{package}': pip install -e '{CHECKOUT}\[{extra}\]'", errors)


def test_every_extra_that_a_message_names_exists() -> None:
    sources = [path for top in ("bestman_bt", "behaviours", "hal") for path in (CHECKOUT / top).rglob("*.py")]
    named = {extra for path in sources for extra in re.findall(r"install_command\([\"'](\w+)", path.read_text())}
    assert {"onnx", "policy", "robots"} <= named
    assert (named | set(PACKAGE_OF_EXTRA)) - set(EXTRAS) == set()


def test_the_page_on_installation_reports_what_every_extra_adds() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", (CHECKOUT / "docs/installation.md").read_text(), re.MULTILINE))
    assert set(rows) == set(EXTRAS)
    for extra in set(EXTRAS) - {"all"}:
        for item in EXTRAS[extra]:
            assert Requirement(item).name in rows[extra], f"{extra}: {item}"


def test_the_extra_all_is_made_of_the_others() -> None:
    (everything,) = map(Requirement, EXTRAS["all"])
    assert everything.name == "bestman-bt"
    assert set(EXTRAS) - everything.extras == {"all", "planning", "pyrobosim", "ray", "slurm", "video"}


@pytest.mark.parametrize(
    "name",
    [
        "py-trees",
        "pybullet",
        "numpy",
        "ompl",
        "toppra",
        "opencv-python-headless",
        "open3d",
        "pyyaml",
        "rerun-sdk",
        "pytest",
    ],
)
def test_the_packages_that_the_project_stands_on_are_named(name: str) -> None:
    requirements = [*CORE, *(item for items in EXTRAS.values() for item in items)]
    assert name in {Requirement(item).name for item in requirements}


@pytest.mark.parametrize("name", ["pybullet", "rerun-sdk", "coacd", "fast-simplification", "onnxruntime", "pyarrow"])
def test_a_package_of_one_feature_is_no_requirement_of_all(name: str) -> None:
    assert name not in {Requirement(item).name for item in CORE}
