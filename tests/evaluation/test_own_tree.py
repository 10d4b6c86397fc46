"""Trees that no task names: audited by what their skills declare, and not judged."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import run_episode
from tests.behaviours.at_the_table import standing_at_a_table, tree_of
from tests.cli.command_line import Program

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/own_tree/take_and_put.xml"
INTO_THE_TABLE = """
import math

from behaviours.arm_motion import move_free
from behaviours.contacts import grasp, handle, push, support
from behaviours.skill import ALGORITHM_ERRORS, Skill, SkillFailure, SkillCoroutine
from behaviours.perception.surfaces import find_surface
from bestman_bt.messages import Pose


class Bump(Skill):
    def execute(self) -> SkillCoroutine[None]:
        skills = self.skills
        furniture, surface = find_surface(skills, "table")
        top = (furniture.pose.to_pose() @ surface.pose).position[2]
        inside = Pose.from_xyz_rpy((0.5, 0.0, top - 0.05), (math.pi, 0.0, 0.0))
        found = skills.kinematics.solve(inside, skills.arm_positions(), skills.rng, attempts=20).solutions
        everything = [kind(name, 1e9) for kind in (grasp, push, handle) for name in ("table", "table/top", "thing")]
        everything += [support(name, "table", 1e9) for name in ("panda_hand", "panda_leftfinger", "fingers", "robot")]
        skills.contacts += everything  # touching() would refuse them
        try:
            yield from move_free(self, found, skills.arm_world(skills.planning_scene(ignore=["table"])))
        except (SkillFailure, *ALGORITHM_ERRORS) as failure:
            self.feedback_message = str(failure)
"""


@pytest.mark.slow
def test_the_first_tree_that_a_user_writes_is_a_success_and_reports_that_nobody_judged_it(tmp_path: Path) -> None:
    answer = Program("run", EXAMPLE, "--seed", 1, "--json", "--runs", tmp_path / "runs", folder=tmp_path).answer()
    result: dict[str, Any] = answer.document
    assert (answer.code, result["success"], result["tree_status"], result["failure"]) == (0, True, "SUCCESS", None)
    assert (result["judged"], result["predicate"]) == (False, None)
    assert result["audit"]["collisions"] == 0
    declared = result["audit"]["declared_contacts"]
    assert {one["kind"] for one in declared} == {"grasp", "support"}
    assert {tuple(one["pair"]) for one in declared} == {("fingers", "cup"), ("cup", "table")}
    assert all(0.0 < one["peak_force_n"] <= one["max_force_n"] for one in declared)
    assert "not judged: the tree names no goal" in answer.err
    (folder,) = (tmp_path / "runs").iterdir()
    assert "not judged: the tree names no goal" in (folder / "log.jsonl").read_text()
    assert "[   0.00 s]" in answer.err, "terminal and log count from the begin of the run"
    ended = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()][-1]
    assert (ended["event"], ended["time"]) == ("end", pytest.approx(result["sim_time_s"], abs=1e-3))
    assert max(one["end_s"] for one in declared) < result["sim_time_s"]
    report = Program("report", folder, "-o", tmp_path / "report.html", folder=tmp_path).answer()
    assert report.code == 0
    assert "not judged: the tree names no goal" in (tmp_path / "report.html").read_text()


def test_no_plugin_can_declare_its_way_through_a_table(tmp_path: Path) -> None:
    plugin, tree = tmp_path / "bump.py", tmp_path / "tree.xml"
    plugin.write_text(INTO_THE_TABLE)
    tree.write_text(tree_of("<Bump/>"))
    result = run_episode(
        load_run(
            tree=tree,
            scene="kitchen",
            robot="diff_panda",
            seed=1,
            settings=standing_at_a_table(110.0),
            plugins=[str(plugin)],
        )
    )
    assert (result.tree_status, result.success, result.judged) == ("SUCCESS", False, False)
    assert result.failure is not None
    assert result.failure.node == "audit"
    assert "with table" in result.failure.why
    assert "no skill declared it" in result.failure.why
