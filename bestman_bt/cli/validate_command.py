"""Example: bestman-bt validate trees/*.xml. Exit code 2 if a file has errors; warnings alone are fine."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Plugins
from bestman_bt.configuration import ConfigurationError, find_data, shipped_trees
from bestman_bt.engine import TreeLoadError, load_tree
from bestman_bt.engine.validation import validate_file
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.tree_checks import ALWAYS_FILLED, TASK_ENTRIES, arm_problems, lacking_parts, unknown_names


def command(
    files: Annotated[list[str], typer.Argument(metavar="FILE…", help="Shipped trees, or XML or Python files.")],
    robot: Annotated[
        str | None, typer.Option("--robot", help="Also whether this robot has the parts that they need.")
    ] = None,
    plugins: Plugins = None,
) -> None:
    """Check tree files without running them."""
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    model, errors = None, 0
    if robot is not None:
        from bestman_bt.robot_model import load_robot_model

        try:
            model = load_robot_model(robot)  # after the plug-ins, which may bring kinds of parts
        except ConfigurationError as error:
            print(error, file=sys.stderr)
            errors = len(error.problems)
    for file in files:
        if Path(file).suffix in (".yaml", ".yml"):
            print(f"{file}: is no tree (.xml or .py); --robot checks a robot, and run a task", file=sys.stderr)
            errors += 1
            continue
        try:
            path = find_data("tree", file)
        except ConfigurationError as error:
            print(error, file=sys.stderr)
            errors += 1
            continue
        problems = validate_file(path, registry, search_path=shipped_trees(), given=(*TASK_ENTRIES, *ALWAYS_FILLED))
        if model is not None:
            with suppress(TreeLoadError):  # told already
                tree = load_tree(path, registry, search_path=shipped_trees(), faults=[])
                postures = {"posture": list(model.postures)} if model.arm_names else {}
                problems += [*lacking_parts(tree, model, model.parts), *arm_problems(tree, model)]
                problems += unknown_names(tree, postures)
        for problem in sorted(problems, key=lambda one: (one.file, one.line)):
            print(problem, file=sys.stderr)
        faulty = sum(problem.severity != "warning" for problem in problems)
        errors += faulty
        if not faulty:
            print(f"{path}: ok")
    sys.exit(2 if errors else 0)
