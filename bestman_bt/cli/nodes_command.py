"""Example: bestman-bt nodes NavigateTo."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from behaviours.failure import own_failures
from behaviours.parts import describe_required_parts
from bestman_bt.cli.options import Plugins
from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import NodeInfo, RegistryError, Tree, load_tree, palette_xml
from bestman_bt.engine.spelling import closest
from bestman_bt.engine.unwritten import entries_of
from bestman_bt.engine.xml.documents import read_documents
from bestman_bt.engine.xml.schema import schema_xsd
from bestman_bt.runtime.plugins import node_registry

KINDS = ("Action", "Condition", "Control", "Decorator", "SubTree")
SHIPPED = ("bestman_bt.", "behaviours.")


def command(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]…", help="Only these nodes and shipped subtrees.")
    ] = None,
    xml: Annotated[bool, typer.Option("--xml", help="Print the TreeNodesModel that Groot2 imports.")] = False,
    xsd: Annotated[
        bool, typer.Option("--xsd", help="Print an XML schema of trees, for completion and checks in editors.")
    ] = False,
    plugins: Plugins = None,
) -> None:
    """List the nodes and shipped subtrees that trees may use, with their ports."""
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    if xml or xsd:
        print(schema_xsd(registry) if xsd else palette_xml(registry), end="")
        return
    subtrees = _shipped_subtrees()
    for name in names or ():
        if name not in registry and name not in subtrees:
            meant = closest(name, [*(info.name for info in registry), *subtrees])
            raise RegistryError(f"unknown node {name!r}" + (f"; did you mean {meant!r}?" if meant else ""))
    infos = [registry.info(name) for name in names if name in registry] if names else registry.manifest()
    for kind in KINDS:
        of_kind = [info for info in infos if info.kind == kind]
        if of_kind:
            print(f"{kind}s" if kind != "SubTree" else kind)
            for info in of_kind:
                _print_text(info)
                if names and info.cls.__module__.startswith(SHIPPED):
                    print(f"      in Python: {info.import_line}")
            print()
    shown = [name for name in subtrees if not names or name in names]
    if shown:
        print("SubTrees that are shipped: include their file")
        files = dict.fromkeys(file.name for file, _ in subtrees.values())
        every = "".join(f'<include path="subtrees/{file}"/>' for file in files)  # they stand on one another
        for name in shown:
            text = f'<root BTCPP_format="4">{every}</root>'
            _print_subtree(load_tree(text, registry, main_tree=name, search_path=shipped_trees()), *subtrees[name])
        print()
    sys.stdout.flush()


def _shipped_subtrees() -> dict[str, tuple[Path, int]]:
    """Return, by ID, the file below ``trees`` that any tree may include, and its line."""
    found = {}
    for folder in shipped_trees():
        for file in sorted((folder / "subtrees").glob("*.xml")):
            for name, definition in read_documents(file, shipped_trees()).trees.items():
                if definition.file == str(file):
                    found[name] = file, definition.element.line
    return found


def _print_subtree(tree: Tree, file: Path, line: int) -> None:
    taken, written = entries_of(tree)
    print(f"  {tree.tree_id}: {file}:{line}")
    print(f'      <include path="subtrees/{file.name}"/>')
    for key, required in taken.items():
        print(f"      {key} ({'input, required' if required else 'input'})")
    if written:
        print(f"      writes {', '.join(written)}")


def _print_text(info: NodeInfo) -> None:
    print(f"  {info.name}: {info.description.splitlines()[0] if info.description else ''}")
    if parts := describe_required_parts(info.cls):
        print(f"      {parts}")
    for port in info.ports.values():
        facts = [port.direction, port.accepts]
        if port.required:
            facts.append("required")
        elif port.default is not None:
            facts.append(port.default_in_words)
        print(f"      {port.name} ({', '.join(facts)}): {port.description}")
    for code, advice in own_failures(info.cls).items():
        print(f"      fails as {code}: {advice}")
