"""Examples: bestman-bt show fetch_cup --tree Pick; bestman-bt show my_tree.xml --svg my_tree.svg."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Plugins
from bestman_bt.configuration import ConfigurationError, Problem, find_data, shipped_trees
from bestman_bt.engine import (
    NoMainTree,
    TreeLoadError,
    load_tree,
    render_dot,
    render_paths,
    render_ports,
    render_svg,
    render_text,
)
from bestman_bt.runtime.plugins import node_registry


def command(
    tree: Annotated[str, typer.Argument(help="A shipped tree, or an XML or Python file.")],
    ports: Annotated[bool, typer.Option("--ports", help="Who maps what to whom across subtrees.")] = False,
    paths: Annotated[
        bool, typer.Option("--paths", help="Number and path of each node, as `break` takes them.")
    ] = False,
    dot: Annotated[bool, typer.Option("--dot", help="Print Graphviz source.")] = False,
    tree_id: Annotated[str | None, typer.Option("--tree", metavar="ID", help="Another tree of an XML file.")] = None,
    svg: Annotated[Path | None, typer.Option(metavar="FILE.svg", help="Write a picture; needs no Graphviz.")] = None,
    plugins: Plugins = None,
) -> None:
    """Print a tree as text, or in one of the other forms."""
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    path = Path(find_data("tree", tree))
    if tree_id is not None and path.suffix == ".py":
        raise ConfigurationError([Problem("--tree", None, "", f"{path} is a Python file, which defines one tree")])
    try:
        loaded = load_tree(path, registry, main_tree=tree_id, search_path=shipped_trees())
    except TreeLoadError as error:
        choose = "choose one by --tree ID"
        raise TreeLoadError(
            [replace(one, suggestion=choose) if isinstance(one, NoMainTree) else one for one in error.problems]
        ) from None
    if svg is not None:
        svg.write_text(render_svg(loaded), encoding="utf-8")
        print(svg)
    elif dot:
        print(render_dot(loaded), end="")
    elif paths:
        print(render_paths(loaded), end="")
    else:
        print(render_ports(loaded) if ports else render_text(loaded), end="")
