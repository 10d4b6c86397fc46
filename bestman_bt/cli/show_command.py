"""Examples: bestman-bt show fetch_cup --tree Pick; bestman-bt show my_tree.xml --svg t.svg; bestman-bt show trees/."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import OtherFiles, grouped_options, is_package, writable_file
from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.engine import (
    NodeInfo,
    Tree,
    TreeLoadError,
    render_dot,
    render_paths,
    render_ports,
    render_svg,
    render_text,
)
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.engine.models.foreign import Placeholders, missing_nodes, open_tree
from bestman_bt.engine.models.overview import models_svg, models_text, overview_dot, overview_svg, overview_text
from bestman_bt.engine.models.package import Package


@grouped_options
def command(
    tree: Annotated[str, typer.Argument(help="A shipped tree, an XML or Python file, a folder or a .btproj.")],
    ports: Annotated[bool, typer.Option("--ports", help="Show how SubTrees map their ports to entries.")] = False,
    paths: Annotated[
        bool, typer.Option("--paths", help="Number and path of each node, as `break` takes them.")
    ] = False,
    dot: Annotated[bool, typer.Option("--dot", help="Print Graphviz source.")] = False,
    tree_id: Annotated[str | None, typer.Option("--tree", metavar="ID", help="Another tree of an XML file.")] = None,
    svg: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Write a picture; needs no Graphviz.", callback=writable_file),
    ] = None,
    others: OtherFiles = OtherFiles(),
) -> None:
    """Print a tree as text or in another format; for a folder, list its trees and which tree uses which.

    Nodes and trees without code are drawn as placeholders, dashed.
    """
    whole = is_package(tree)
    package = others.package(tree if whole else None)
    if whole and tree_id is None:
        _print(overview_svg(package) if svg else overview_dot(package) if dot else overview_text(package), svg)
        package.refuse_broken()
        return
    path = Path(package.file_of(tree_id or "", tree)) if whole else find_data("tree", tree)
    if tree_id is not None and path.suffix == ".py":
        raise ConfigurationError([Problem("--tree", None, "", f"{path} is a Python file, which defines one tree")])
    if tree_id is None and (described := _nodes_of_a_file_without_trees(path)):
        _print(models_svg(described) if svg else models_text(described), svg)
        return
    registry = others.registry()
    faults: list[TreeProblem] = []
    gaps = Placeholders()
    loaded = open_tree(
        path, registry, main_tree=tree_id, search_path=shipped_trees(), faults=faults, package=package, gaps=gaps
    )
    if svg is not None:
        _print(render_svg(loaded), svg)
    elif dot:
        _print(render_dot(loaded))
    elif paths:
        _print(render_paths(loaded))
    else:
        _print(render_ports(loaded) if ports else render_text(loaded))
    _report_placeholders(loaded, [gap for gap in gaps.problems if gap.node in registry])
    if faults:
        raise TreeLoadError(faults)


def _print(text: str, file: Path | None = None) -> None:
    """Write into the file, whose name is printed, or to standard output."""
    if file is None:
        print(text, end="")
    else:
        file.write_text(text, encoding="utf-8")
        print(file)


def _nodes_of_a_file_without_trees(path: Path) -> list[NodeInfo]:
    if path.suffix == ".py":
        return []
    package = Package.open([path], shipped_trees())
    return [] if any(package.trees()) else list(package.models.values())


def _report_placeholders(tree: Tree, misfits: list[TreeProblem]) -> None:
    """Print to standard error which nodes have no code here and where they are declared, then what does not match the
    code.
    """
    sys.stdout.flush()
    wrong = {misfit.node for misfit in misfits}
    missing = {name: info for name, info in missing_nodes(tree).items() if name not in wrong}
    if missing:
        print(
            f"{len(missing)} type{'s of nodes have' if len(missing) > 1 else ' of node has'} no code here:",
            file=sys.stderr,
        )
    for name, info in sorted(missing.items()):
        print(f"  {name} ({info.kind}): {info.known_from}", file=sys.stderr)
    if misfits:
        print("drawn as placeholders, as they do not fit the nodes of their name here:", file=sys.stderr)
    for misfit in misfits:
        print(f"  {misfit}", file=sys.stderr)
