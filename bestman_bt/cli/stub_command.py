"""Example: bestman-bt stub my_trees/ -o leaves.py; then bestman-bt run my_tree.xml --plugin leaves.py."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Models, Plugins, writable_file
from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine.models.node_models import unknown_types
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.stubs import stub_source
from bestman_bt.runtime.plugins import node_registry


def command(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH…", help="Tree files, folders or .btproj.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE.py", help="File to create or extend.", callback=writable_file),
    ],
    models: Models = None,
    plugins: Plugins = None,
) -> None:
    """Write Python classes for the leaves without code; classes that the file already has are kept."""
    if output.suffix != ".py":
        raise typer.BadParameter(f"should be a Python file (.py), got '{output}'", param_hint="--output")
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    package = Package.open(paths, shipped_trees())
    package.refuse_broken()
    further = Package.open(models or (), shipped_trees())
    further.refuse_broken()
    unknown = unknown_types(package.files.values(), registry, {**further.models, **package.models})
    existing = output.read_bytes() if output.exists() else b""
    content, added = stub_source(unknown.values(), existing, str(output))
    if added:
        output.write_bytes(content)
    print(f"{output}: {len(added)} added, {len(unknown) - len(added)} existed already or are not leaves")
    others = sorted(name for name, info in unknown.items() if info.kind not in ("Action", "Condition"))
    if others:
        print(f"no leaves, to be written by hand: {', '.join(others)}", file=sys.stderr)
