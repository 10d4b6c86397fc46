"""XML schema of a registry's nodes: completion and checks in editors (VS Code with Red Hat's XML, IntelliJ)."""

from __future__ import annotations

from typing import Final

from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
from bestman_bt.engine.xml.checking import EXPLICIT, SCRIPTS
from bestman_bt.engine.xml.writer import escape

_HEAD: Final = """<?xml version="1.0" encoding="UTF-8"?>
<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">
<xs:element name="root"><xs:complexType>
<xs:choice minOccurs="0" maxOccurs="unbounded">
<xs:element name="include"><xs:complexType>
<xs:attribute name="path"/><xs:attribute name="ros_pkg"/>
</xs:complexType></xs:element>
<xs:element ref="BehaviorTree"/>
<xs:element name="TreeNodesModel"><xs:complexType><xs:sequence>
<xs:any processContents="skip" minOccurs="0" maxOccurs="unbounded"/>
</xs:sequence></xs:complexType></xs:element>
</xs:choice>
<xs:attribute name="BTCPP_format" use="required"><xs:simpleType><xs:restriction base="xs:string">
<xs:enumeration value="4"/></xs:restriction></xs:simpleType></xs:attribute>
<xs:attribute name="main_tree_to_execute"/><xs:anyAttribute processContents="skip"/>
</xs:complexType></xs:element>
<xs:element name="BehaviorTree"><xs:complexType>
<xs:group ref="node"/><xs:attribute name="ID"/><xs:anyAttribute processContents="skip"/>
</xs:complexType></xs:element>
"""


def schema_xsd(registry: NodeRegistry) -> str:
    """Return a schema (XSD 1.0) of trees: every node with its ports, its number of children and its description."""
    infos = [info for info in registry.manifest() if info.kind != "SubTree"]
    scripts = "".join(f'<xs:attribute name="{name}"/>' for name in sorted(SCRIPTS))
    parts = [
        _HEAD,
        f'<xs:attributeGroup name="of_every_node"><xs:attribute name="name"/>{scripts}</xs:attributeGroup>\n',
        '<xs:group name="node"><xs:choice>\n',
        *(f'<xs:element ref="{name}"/>\n' for name in (*(info.name for info in infos), "SubTree", *sorted(EXPLICIT))),
        "</xs:choice></xs:group>\n",
        *(_element(info) for info in infos),
        '<xs:element name="SubTree"><xs:complexType><xs:attribute name="ID" use="required"/>'
        '<xs:anyAttribute processContents="skip"/></xs:complexType></xs:element>\n',
        *(_explicit(kind) for kind in sorted(EXPLICIT)),
        "</xs:schema>\n",
    ]
    return "".join(parts)


def _element(info: NodeInfo) -> str:
    attributes = "".join(_port(info, name) for name in info.ports if name != "name")
    return (
        f'<xs:element name="{escape(info.name)}">{_documented(info.description)}<xs:complexType>'
        f"{_children(info.min_children, info.max_children)}"
        f'<xs:attributeGroup ref="of_every_node"/>{attributes}</xs:complexType></xs:element>\n'
    )


def _port(info: NodeInfo, name: str) -> str:
    port = info.ports[name]
    default = "" if port.default is None else f"; {port.default_in_words}"
    words = f"{port.direction}, {port.accepts}{default}. {port.description}"
    use = ' use="required"' if port.required else ""
    return f'<xs:attribute name="{escape(name)}"{use}>{_documented(words)}</xs:attribute>'


def _explicit(kind: str) -> str:
    children = "" if kind in ("Action", "Condition") else _children(1, 1 if kind == "Decorator" else None)
    return (
        f'<xs:element name="{kind}"><xs:complexType>{children}<xs:attribute name="ID" use="required"/>'
        '<xs:anyAttribute processContents="skip"/></xs:complexType></xs:element>\n'
    )


def _children(least: int, most: int | None) -> str:
    if most == 0:
        return ""
    return f'<xs:sequence><xs:group ref="node" minOccurs="{least}" maxOccurs="{most or "unbounded"}"/></xs:sequence>'


def _documented(words: str) -> str:
    text = escape(" ".join(words.split()))
    return f"<xs:annotation><xs:documentation>{text}</xs:documentation></xs:annotation>" if text else ""
