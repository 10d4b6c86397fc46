"""Example: bestman-bt nodes NavigateTo."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from behaviours.failure import own_failures
from behaviours.parts import parts_in_words
from bestman_bt.cli.options import Plugins
from bestman_bt.engine import NodeInfo, palette_xml
from bestman_bt.runtime.plugins import node_registry

KINDS = ("Action", "Condition", "Control", "Decorator", "SubTree")
SHIPPED = ("bestman_bt.", "behaviours.")


def command(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]…", help="Only these nodes.")] = None,
    xml: Annotated[bool, typer.Option("--xml", help="Print the TreeNodesModel that Groot2 imports.")] = False,
    plugins: Plugins = None,
) -> None:
    """List the nodes that trees may use, with their ports."""
    registry = node_registry([str(plugin) for plugin in plugins or ()])
    if xml:
        print(palette_xml(registry), end="")
        return
    infos = [registry.info(name) for name in names] if names else registry.manifest()
    for kind in KINDS:
        of_kind = [info for info in infos if info.kind == kind]
        if of_kind:
            print(f"{kind}s" if kind != "SubTree" else kind)
            for info in of_kind:
                _tell(info)
                if names and info.cls.__module__.startswith(SHIPPED):
                    print(f"      in Python: {info.import_line}")
            print()
    sys.stdout.flush()


def _tell(info: NodeInfo) -> None:
    print(f"  {info.name}: {info.description.splitlines()[0] if info.description else ''}")
    if parts := parts_in_words(info.cls):
        print(f"      {parts}")
    for port in info.ports.values():
        facts = [port.direction, port.type_name]
        if port.required:
            facts.append("required")
        elif port.default is not None:
            facts.append(f"default {port.default}")
        print(f"      {port.name} ({', '.join(facts)}): {port.description}")
    for code, advice in own_failures(info.cls).items():
        print(f"      fails as {code}: {advice}")
