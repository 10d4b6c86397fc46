"""Example: bestman-bt show fetch_cup."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Plugins
from bestman_bt.configuration import find_data
from bestman_bt.engine import load_tree
from bestman_bt.engine.display import render_text
from bestman_bt.runtime.plugins import node_registry


def command(
    tree: Annotated[str, typer.Argument(help="A shipped tree, or an XML or Python file.")], plugins: Plugins = None
) -> None:
    """Print a tree."""
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    print(render_text(load_tree(Path(find_data("tree", tree)), registry)), end="")
