"""Example: bestman-bt validate trees/*.xml. Exit code 2 if a file is invalid, 1 if a node, port or tree is missing
here.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bestman_bt.cli.options import OtherFiles, grouped_options, is_package
from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import NoMainTree, TreeLoadError, TreeProblem
from bestman_bt.engine.errors import in_lines
from bestman_bt.engine.models.foreign import StrictPlaceholders, open_tree
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.validation import validate_file
from bestman_bt.runtime.tree_checks import ALWAYS_FILLED, TASK_ENTRIES, arm_problems, lacking_parts, unknown_names

if TYPE_CHECKING:
    from bestman_bt.engine import NodeRegistry
    from bestman_bt.engine.xml.documents import TreeDefinition
    from bestman_bt.robot_model.model import RobotModel

MOST_NAMES = 20
"""Largest numbers of unknown nodes and of unused trees named in a summary."""
_UNKNOWN = re.compile(r"unknown node '(.*)'")


@grouped_options
def command(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE…", help="Shipped trees, XML or Python files, folders or .btproj.")
    ],
    robot: Annotated[
        str | None, typer.Option("--robot", help="Also whether this robot has the parts that they need.")
    ] = None,
    others: OtherFiles = OtherFiles(),
) -> None:
    """Check tree files without running them.

    Exit code 0: at most warnings. 1: a node, port or tree is missing here; the file may be valid elsewhere. 2: a file
    is invalid, including ports of nodes that are implemented here, unless the file's TreeNodesModel declares other
    ports.
    """
    registry = others.registry()
    model, worst = None, 0
    if robot is not None:
        from bestman_bt.robot_model.compose import load_robot_model

        try:
            model = load_robot_model(robot)  # after the plug-ins, which may bring kinds of parts
        except ConfigurationError as error:
            print(error, file=sys.stderr)
            worst = 2
    try:
        further = others.package()
    except TreeLoadError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    for file in files:
        if is_package(file):
            worst = max(worst, _check_package(file, others.paths, registry))
        else:
            worst = max(worst, _check_file(file, registry, further, model))
    sys.exit(worst)


def _check_file(file: str, registry: NodeRegistry, package: Package, model: RobotModel | None) -> int:
    if Path(file).suffix in (".yaml", ".yml"):
        print(
            f"{file}: validate checks trees (.xml, .py); for a robot there is bestman-bt robot check {file}, "
            f"and a task is checked by bestman-bt run --task {file} before anything starts",
            file=sys.stderr,
        )
        return 2
    try:
        path = find_data("tree", file)
    except ConfigurationError as error:
        print(error, file=sys.stderr)
        return 2
    given = (*TASK_ENTRIES, *ALWAYS_FILLED)
    problems = validate_file(path, registry, search_path=shipped_trees(), given=given, package=package)
    if model is not None:
        with suppress(TreeLoadError):  # told already
            gaps = StrictPlaceholders(package.models)
            tree = open_tree(path, registry, search_path=shipped_trees(), gaps=gaps, faults=[], package=package)
            postures = {"posture": list(model.postures)} if model.arm_names else {}
            problems += [*lacking_parts(tree, model, model.parts), *arm_problems(tree, model)]
            problems += unknown_names(tree, postures)
    for line in in_lines(sorted(problems, key=lambda one: (one.file, one.line))):
        print(line, file=sys.stderr)
    code = _exit_code(problems)
    if code == 0:
        print(f"{path}: ok")
    elif code == 1:
        count = sum(problem.severity != "warning" for problem in problems)
        print(f"{path}: nothing is wrong, {count} thing{'s are' if count > 1 else ' is'} missing here")
    return code


def _exit_code(problems: Iterable[TreeProblem]) -> int:
    faulty = [problem for problem in problems if problem.severity != "warning"]
    return 0 if not faulty else 1 if all(problem.missing for problem in faulty) else 2


def _check_package(folder: str, further: list[Path], registry: NodeRegistry) -> int:
    """Check all files of a package, and sum up."""
    try:
        package = Package.open([folder, *further], shipped_trees())
    except TreeLoadError as error:
        print(error, file=sys.stderr)
        return 2
    given = (*TASK_ENTRIES, *ALWAYS_FILLED)
    found = list(package.problems)
    for file in package.files:
        if Path(file).suffix == ".xml":
            search = (*shipped_trees(), Path(folder) if Path(folder).is_dir() else Path(folder).parent)
            found += validate_file(file, registry, search_path=search, given=given, package=package)
    found = [problem for problem in found if not isinstance(problem, NoMainTree)]  # a file of trees for others
    problems = list({replace(problem, suggestion=""): problem for problem in found}.values())
    unknown = [problem for problem in problems if _UNKNOWN.match(problem.message)]
    to_print = [problem for problem in problems if problem not in set(unknown)]
    for line in in_lines(sorted(to_print, key=lambda one: (one.file, one.line))):
        print(line, file=sys.stderr)
    _sum_up(folder, package, problems, Counter(problem.message for problem in unknown))
    return _exit_code(problems)


def _sum_up(folder: str, package: Package, problems: list[TreeProblem], unknown: Counter[str]) -> None:
    faulty = [problem for problem in problems if problem.severity != "warning"]
    missing = sum(problem.missing for problem in faulty)
    print(
        f"{folder}: {len(package.files)} files, {len(list(package.trees()))} trees; {len(faulty) - missing} wrong, "
        f"{missing} missing here, {len(problems) - len(faulty)} warnings"
    )
    if package.others:
        print(f"  {package.others} further XML files hold no trees")
    if unknown:
        print(f"  {len(unknown)} types of nodes have no code here:")
        for message, count in unknown.most_common(MOST_NAMES):
            print(f"    {count:>5}  {message.removeprefix('unknown node ')[1:-1]}")
        if len(unknown) > MOST_NAMES:
            print(f"    and {len(unknown) - MOST_NAMES} more")
    if unused := [one.tree_id for one in package.unused()]:
        print(f"  {len(unused)} trees that no other uses: {_some(unused)}")
    doubled = sorted(package.duplicates(), key=len, reverse=True)
    for found in doubled[:MOST_NAMES]:
        print(
            f"  '{found[0].tree_id}' is defined {len(found)} times, first at {_place(found[0])} and {_place(found[1])}"
        )
    if len(doubled) > MOST_NAMES:
        print(f"  and {len(doubled) - MOST_NAMES} more IDs are defined several times")


def _place(definition: TreeDefinition) -> str:
    return f"{definition.file}:{definition.element.line}"


def _some(names: Iterable[str]) -> str:
    shown = list(names)
    rest = f" and {len(shown) - MOST_NAMES} more" if len(shown) > MOST_NAMES else ""
    return ", ".join(shown[:MOST_NAMES]) + rest
