"""The benchmark on MotionBenchMaker's problems reads scenes and requests of MoveIt and judges what planners answer."""

import io
import json
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "motion_bench_maker.py"
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
START = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
ASIDE = [1.6, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
BOX = {"id": "post", "shape": ("box", [0.05, 0.05, 1.0]), "at": [0.40, 0.40, 0.5]}


def problem(goal: list[float], *bodies: dict) -> dict[str, dict]:
    """A request and its scene, as MotionBenchMaker writes them."""
    names = [*JOINTS, "panda_finger_joint1", "panda_finger_joint2"]
    objects = [
        {
            "id": body["id"],
            "primitives": [{"type": body["shape"][0], "dimensions": body["shape"][1]}],
            "primitive_poses": [{"position": body["at"], "orientation": [0, 0, 0, 1]}],
        }
        for body in bodies
    ]
    goals = [{"joint_name": name, "position": value} for name, value in zip(JOINTS, goal, strict=True)]
    request = {
        "start_state": {"joint_state": {"name": names, "position": [*START, 0.065, 0.065]}},
        "goal_constraints": [{"joint_constraints": goals}],
    }
    return {"request": request, "scene": {"world": {"collision_objects": objects}}}


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    inside = dict(BOX, at=[0.0, 0.45, 0.5], shape=("cylinder", [0.6, 0.2]))
    problems = [problem(ASIDE, BOX), problem(ASIDE, inside), problem([9.0, *ASIDE[1:]], BOX)]
    with tarfile.open(tmp_path / "problems.tar.bz2", "w:bz2") as files:
        for number, texts in enumerate(problems, 1):
            for kind, content in texts.items():
                data = json.dumps(content).encode()
                entry = tarfile.TarInfo(f"problems/posts_panda/{kind}{number:04}.yaml")
                entry.size = len(data)
                files.addfile(entry, io.BytesIO(data))
    return tmp_path / "problems.tar.bz2"


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True)


@pytest.mark.slow
def test_problems_are_solved_judged_and_compared_and_impossible_ones_listed(archive):
    found = run("--archive", archive, "--robot", "panda", "--json")
    assert found.returncode == 0, found.stderr
    document = json.loads(found.stdout)
    assert document["problems"] == 1
    assert document["left_out"] == {
        "posts_panda/0002": "goal in collision",
        "posts_panda/0003": "goal outside the limits of panda_joint1",
    }
    ours = document["planners"]["ours"]
    assert (ours["solved"], ours["strictly_free"]) == (1, 1)
    assert ours["plan_ms"]["median"] > 0
    assert ours["cost_ratio"] > 0
    assert ours["families"]["posts_panda"]["solved"] == 1
    assert set(document["planners"]) == {"ours", "ompl_rrt_connect", "ompl_aorrtc"}


@pytest.mark.slow
def test_bad_input_is_refused_with_exit_code_2(archive, tmp_path):
    wrong = tmp_path / "none.tar.bz2"
    wrong.write_text("no archive")
    for arguments, word in (
        (("--archive", wrong, "--robot", "panda"), "cannot be read as an archive"),
        (("--archive", archive, "--robot", "ur5"), "--urdf"),
        (("--archive", archive, "--robot", "nothing.yaml"), "nothing.yaml"),
    ):
        found = run(*arguments)
        assert found.returncode == 2
        assert word in found.stderr
