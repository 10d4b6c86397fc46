"""What the documentation shows is true: its trees and its Python load, its pages are all reachable."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

from bestman_bt.cli.main import VERBS
from bestman_bt.configuration.errors import Problem
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import TreeLoadError, load_tree
from bestman_bt.facts.goals.goal import read_goals
from bestman_bt.messages import Pose
from bestman_bt.registry import GOALS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.algorithms import Algorithms
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import session
from bestman_bt.runtime.tree_checks import TASK_ENTRIES
from bestman_bt.world_model.world_model import ObjectBelief

CHECKOUT = Path(__file__).resolve().parents[2]
DOCS = CHECKOUT / "docs"


def fences(page: str, language: str) -> list[str]:
    """The fenced blocks of a page in one language."""
    text = (CHECKOUT / page).read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_trees_in_python_load(tmp_path: Path) -> None:
    programs = [text for text in fences("docs/writing_a_tree.md", "python") if "def build" in text]
    assert programs
    for text in programs:
        file = tmp_path / "tree.py"
        file.write_text(text)
        assert load_tree(file, node_registry()).nodes


ALGORITHM_BLOCKS = [
    pytest.param(text, id=f"{page.stem}-{number}")
    for page in sorted(DOCS.rglob("*.md"))
    for number, text in enumerate(fences(str(page.relative_to(CHECKOUT)), "yaml"))
    if text.startswith("algorithms:")
]


@pytest.mark.parametrize("text", ALGORITHM_BLOCKS)
def test_the_choices_of_algorithms_are_accepted(text: str, tmp_path: Path) -> None:
    task = tmp_path / "task.yaml"
    task.write_text("tree: navigate\nscene: kitchen\nrobot: diff_panda\n" + text)
    config, model = load_run(task), load_robot_model("diff_panda")
    asked = yaml.safe_load(text)["algorithms"]
    made = Algorithms(config, model)
    assert asked
    for slot, choice in asked.items():
        name, parameters = config.task.algorithm(slot)
        assert name == choice.get("algorithm", name)
        assert parameters.keys() >= choice.keys() - {"algorithm"}
    assert made.global_planning
    assert made.local_planning


def test_the_task_of_the_page_on_tasks_can_start(tmp_path: Path) -> None:
    (text,) = fences("docs/writing_a_task.md", "yaml")
    file = tmp_path / "can_to_counter.yaml"
    file.write_text(text)
    setup = prepare(load_run(file, seed=1))
    assert (setup.goals[0].object, setup.goals[0].surface) == ("can", "counter")


@pytest.mark.parametrize(
    ("kind", "asked"),
    re.findall(r"^\| `(\w+)` \| `(\{.*?\})`[;| ]", (DOCS / "writing_a_task.md").read_text(), re.MULTILINE),
)
def test_what_a_task_can_ask_is_accepted(kind: str, asked: str, tmp_path: Path) -> None:
    file = tmp_path / "task.yaml"
    file.write_text(f"tree: navigate\nscene: kitchen\nrobot: diff_panda\ngoals: [{{{kind}: {asked}}}]\n")
    faults: list[Problem] = []
    assert list(read_goals(load_run(file), faults))
    assert not faults


def test_the_programs_of_a_session_run(capsys: pytest.CaptureFixture[str]) -> None:
    _, ticked, without_robot = fences("docs/running.md", "python")
    for text in (ticked, without_robot):
        exec(compile(text, "running.md", "exec"), {})
    assert capsys.readouterr().out == "SUCCESS []\nFetch 57 x;y;theta in the map frame, metres and radians\n"


@pytest.mark.slow
def test_the_program_of_the_black_box_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = next(one for one in fences("docs/hardware.md", "python") if "black_box" in one)
    exec(compile(text, "hardware.md", "exec"), {})
    assert capsys.readouterr().out.startswith("stop() was called -0.6")


@pytest.mark.parametrize("page", ["docs/writing_a_skill.md", "README.md"])
def test_the_skills_are_leaves_that_a_plugin_adds(page: str, tmp_path: Path) -> None:
    (text,) = (text for text in fences(page, "python") if "Nod(Skill)" in text)
    plugin = tmp_path / "nod.py"
    plugin.write_text(text)
    leaf = node_registry([str(plugin)]).info("Nod")
    assert leaf.kind == "Action"
    assert [port.name for port in leaf.inputs] == ["times"]


def test_the_skill_of_the_readme_runs_and_fails_as_it_declares(tmp_path: Path) -> None:
    (text,) = (text for text in fences("README.md", "python") if "(Skill)" in text)
    plugin = tmp_path / "nod.py"
    plugin.write_text(text)
    tree = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Nod times="{}"/></BehaviorTree></root>'
    with session(seed=3, plugins=[str(plugin)]) as opened:
        before = opened.skills.joints.positions()
        assert opened.run(tree.format(2)).succeeded
        after = opened.skills.joints.positions()
        assert max(abs(after[joint] - before[joint]) for joint in after) > 0.1
        assert opened.run(plugin).succeeded
        assert not opened.run(tree.format(0)).succeeded
        (failure,) = opened.skills.failures
        nod = opened.setup.registry.info("Nod").cls
    assert nod.DECLARATION.effects == ("nodded()",)
    assert failure.error_code in nod.FAILS


@pytest.mark.slow
def test_the_skill_with_outputs_and_names_runs(tmp_path: Path) -> None:
    (text,) = (text for text in fences("docs/writing_a_skill.md", "python") if "LookAround(Skill)" in text)
    plugin = tmp_path / "look_around.py"
    plugin.write_text(text)
    tree = '<root BTCPP_format="4"><BehaviorTree ID="Main"><LookAround {}/></BehaviorTree></root>'
    before_the_table = [f"scene.robot_start.{axis}=[0.0, 0.05]" for axis in ("x", "y", "yaw")]
    with session(task="pick_place_table", seed=3, settings=before_the_table, plugins=[str(plugin)]) as opened:
        for wrong, told in (('surface="tabel"', "did you mean 'table'"), ('surface="table" duration="-1"', "duration")):
            with pytest.raises(TreeLoadError, match=told):
                opened.run(tree.format(f'object="cup" {wrong}'))
        began = opened.robot.clock.now()
        assert not opened.run(tree.format('surface="table" object="cup" duration="1.5"')).succeeded
        assert opened.robot.clock.now() - began > 1.5, opened.skills.failures
        (failure,) = opened.skills.failures
        assert failure.error_code == "object_not_found"
        skills = opened.skills
        there = skills.map_from_base @ Pose([0.3, 0.4, 0.8])
        skills.world.objects["cup"] = ObjectBelief("cup", skills.world.models["cup"], there, 1.0, 0.001, began)
        looked = opened.load(tree.format('surface="table" object="cup" duration="0.1" distance="{distance}"'))
        assert opened.executor(looked).run().succeeded
        assert looked.blackboard.get("distance") == pytest.approx(0.5, abs=1e-3)


def test_every_page_is_in_the_navigation() -> None:
    settings = yaml.load((CHECKOUT / "mkdocs.yml").read_text(), Loader=yaml.BaseLoader)
    named = set(re.findall(r"[\w/]+\.md", str(settings["nav"])))
    assert {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} == named


@pytest.mark.slow
def test_the_documentation_builds_without_a_warning(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)],
        cwd=CHECKOUT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr


def test_links_of_the_top_pages_lead_somewhere() -> None:
    for page in ("README.md", "CONTRIBUTING.md"):
        for target in re.findall(r"\]\(([^)#]+)\)", (CHECKOUT / page).read_text()):
            if target.startswith("docs/images/") and not (DOCS / "images").exists():
                continue  # the source archive has no pictures
            assert target.startswith("https://") or (CHECKOUT / target).exists(), f"{page}: {target}"


def test_the_readme_links_every_page() -> None:
    linked = set(re.findall(r"\]\(docs/([^)#]+\.md)", (CHECKOUT / "README.md").read_text()))
    assert {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} == linked


def test_the_commands_of_the_readme_exist() -> None:
    verbs = re.findall(r"`bestman-bt (\w+)", (CHECKOUT / "README.md").read_text())
    assert len(verbs) >= 10
    assert set(verbs) <= set(VERBS)


def test_the_page_of_parameters_is_up_to_date() -> None:
    written = runpy.run_path(str(CHECKOUT / "scripts" / "parameter_page.py"))["page"]()
    assert (DOCS / "parameters.md").read_text() == written, "run scripts/parameter_page.py"


def test_the_table_of_facts_is_that_of_the_predicates() -> None:
    written = runpy.run_path(str(CHECKOUT / "scripts" / "fact_table.py"))["page"]()
    assert (DOCS / "task_planning.md").read_text() == written, "run scripts/fact_table.py"


def test_all_that_a_task_may_ask_is_in_the_table_of_the_page() -> None:
    rows = [row for row in (DOCS / "writing_a_task.md").read_text().splitlines() if row.startswith("| `")]
    for name in GOALS:
        kind: Any = GOALS.resolve(name)
        (row,) = [row for row in rows if row.startswith(f"| `{name}` |") and row.count("|") == 5]
        assert any(f"`{predicate}`" in row for predicate in kind.measures)
        assert set(kind.fills) <= {*TASK_ENTRIES}


def test_parameters_have_units_where_their_descriptions_say_one() -> None:
    rows = [line.split(" | ") for line in (DOCS / "parameters.md").read_text().splitlines() if line.startswith("| `")]
    units = {row[0].strip("|` "): row[2] for row in rows}
    assert (units["max_tilt"], units["cost_decay"], units["ransac_samples"]) == ("rad", "m", "-")
    unsaid = [
        row[0]
        for row in rows
        if row[2] in ("", "-") and re.match(r"(metres|m|rad|radians|seconds|Hz|m/s|pixels|voxels)\\b", row[3])
    ]
    assert unsaid == []


@pytest.mark.parametrize(
    "path", ["algorithms.costmap.clearance=0.02", "algorithms.local_planning.turning.max_speed=0.8"]
)
def test_the_set_paths_of_the_page_of_parameters_are_accepted(path: str) -> None:
    setting = path.partition("=")[0]
    assert f"`{setting}=`" in (DOCS / "parameters.md").read_text()
    config = load_run("fetch_cup", settings=[path])
    Algorithms(config, load_robot_model(config.task.robot))


def test_the_files_of_where_do_i_change_are_there() -> None:
    table = (CHECKOUT / "CONTRIBUTING.md").read_text().split("## Where do I change")[1]
    named = re.findall(r"`([\w/]+(?:/|\.\w+))`", table)
    assert len(named) >= 30
    assert [name for name in named if not (CHECKOUT / name).exists()] == []


PACKAGES = ("bestman_bt", "behaviours", "hal")
SUB_PACKAGES = sorted(f.parent.name for package in PACKAGES for f in (CHECKOUT / package).glob("*/__init__.py"))
WHOLE_NAME = re.compile(rf"(?<![\w./:-])(?:{'|'.join(PACKAGES)})(?:\.(?!md\b|py\b)[A-Za-z_]\w*)+")
SHORT_NAME = re.compile(rf"(?<=`)(?:{'|'.join(SUB_PACKAGES)})(?:\.[A-Za-z_]\w*)+(?=[`(\[ ])")
NO_NAMES = {"control.sock", "parts.arm.xyz", "simulation.actor", "bestman_bt.scene.walker", "behaviours.grasp"}
NO_NAMES |= {f"world_model.{attribute}" for attribute in ("obstacles", "occupancy", "articulations")}
"""A file, a key of a robot file, attributes of objects, and old modules in an error that docs/migration.md quotes."""


@cache
def is_defined(name: str) -> bool:
    """Whether a dotted name is a module of the checkout or is defined in one; nothing is imported."""
    place, parts = CHECKOUT, name.split(".")
    while parts and (place / parts[0]).is_dir():
        place /= parts.pop(0)
    if parts and (module := place / f"{parts[0]}.py").is_file():
        return len(parts) == 1 or bool(re.search(rf"^(def |class )?{parts[1]}\b", module.read_text(), re.MULTILINE))
    return not parts or bool(re.search(rf"\b{parts[0]}\b", (place / "__init__.py").read_text()))


def test_the_dotted_names_in_pages_docstrings_and_messages_exist() -> None:
    files = [CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md", *DOCS.rglob("*.md")]
    files += [file for package in PACKAGES for file in (CHECKOUT / package).rglob("*.py")]
    texts = {file: re.sub(r"^\s*(from|import) .*", "", file.read_text(), flags=re.MULTILINE) for file in files}
    old_names = re.compile(r"^\|.*? \|", re.MULTILINE)
    texts[DOCS / "migration.md"] = old_names.sub("", texts[DOCS / "migration.md"])
    groups = {group for text in texts.values() for group in re.findall(r'Registry\(\s*"([\w.]+)"', text)}
    named = [(file, name, [name]) for file, text in texts.items() for name in WHOLE_NAME.findall(text)]
    for file, text in texts.items():
        named += [(file, name, [f"{package}.{name}" for package in PACKAGES]) for name in SHORT_NAME.findall(text)]
    assert len(named) > 500
    assert [
        f"{file.relative_to(CHECKOUT)}: {name}"
        for file, name, meant in named
        if name not in NO_NAMES | groups and not any(is_defined(one) for one in meant)
    ] == []
