"""Commands that only read answer at once: none of them loads a physics engine, a planner or a plotting library."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_names
from tests.evaluation.report.run_folders import write_run

HEAVY = frozenset(
    ("cv2", "matplotlib", "networkx", "ompl", "pinocchio", "coal", "pybullet", "rerun", "scipy", "toppra", "trimesh")
)
"""What takes a tenth of a second or more to load."""

LOADED = """
import atexit, sys
atexit.register(lambda: print("LOADED", *sorted({name.partition(".")[0] for name in sys.modules}), file=sys.stderr))
from bestman_bt.cli.main import main
main()
"""


def answer(*arguments: str, folder: Path) -> tuple[str, set[str]]:
    """What a command prints, and the packages that it has loaded when it ends well."""
    command = [sys.executable, "-c", LOADED, *arguments]
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *told, loaded = done.stderr.splitlines()
    assert not any("build time" in line for line in told)
    return done.stdout, set(loaded.split()[1:])


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--help",), "validate"),
        (("version",), "bestman-bt"),
        pytest.param(("nodes",), "NavigateTo", marks=pytest.mark.slow),
        (("nodes", "PlanGrasp", "ComputePathToPose"), "planner_id"),
        pytest.param(("nodes", "--xml"), "TreeNodesModel", marks=pytest.mark.slow),
        (("domain",), "PickUp(object: object, place: place)"),
        pytest.param(("show", "fetch_cup"), "PickAndPlace", marks=pytest.mark.slow),
        (("show", "fetch_cup", "--ports"), "goal"),
        pytest.param(("show", "fetch_cup", "--tree", "PutAside"), "Sequence 'put_aside'", marks=pytest.mark.slow),
        (("validate", *data_names("tree")), "fetch_cup.xml: ok"),
        (("stop",), ""),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else "",
)
def test_a_command_that_only_reads_loads_no_algorithm(tmp_path: Path, arguments: tuple[str, ...], told: str) -> None:
    out, loaded = answer(*arguments, folder=tmp_path)
    assert told in out
    assert not loaded & (HEAVY | {"pydantic"})


@pytest.mark.slow
def test_a_failure_is_explained_without_the_simulator_and_without_algorithms(tmp_path: Path) -> None:
    write_run(tmp_path / "run", success=False)
    out, loaded = answer("explain", "run", folder=tmp_path)
    assert "slipped" in out
    assert not loaded & HEAVY


@pytest.mark.slow
def test_a_report_is_written_without_the_simulator_and_without_algorithms(tmp_path: Path) -> None:
    write_run(tmp_path / "run")
    out, loaded = answer("report", "run", "-o", "run.html", folder=tmp_path)
    assert out.strip() == "run.html"
    assert not loaded & HEAVY


@pytest.mark.slow
def test_pybullet_prints_nothing_when_a_command_imports_it(tmp_path: Path) -> None:
    program = "import hal.pybullet.robot, sys; sys.exit('pybullet' not in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.slow
def test_any_tree_may_include_the_shipped_subtrees(tmp_path: Path) -> None:
    tree = tmp_path / "mine.xml"
    tree.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Mine"><include path="subtrees/pick_and_place.xml"/>'
        '<BehaviorTree ID="Mine"><SubTree ID="Pick" object="cup" surface="table"/></BehaviorTree></root>'
    )
    assert "mine.xml: ok" in answer("validate", str(tree), folder=tmp_path)[0]
    assert "PlanGrasp" in answer("show", str(tree), folder=tmp_path)[0]
