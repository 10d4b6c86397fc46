"""The XML schema of trees, for editors."""

from __future__ import annotations

from xml.etree import ElementTree

from bestman_bt.engine import NodeRegistry
from bestman_bt.engine.xml.schema import schema_xsd
from bestman_bt.runtime.plugins import node_registry

XS = "{http://www.w3.org/2001/XMLSchema}"


def test_every_node_is_there_with_its_ports_and_children() -> None:
    registry = node_registry()
    root = ElementTree.fromstring(schema_xsd(registry))
    elements = {element.get("name"): element for element in root.findall(f"{XS}element")}
    assert elements.keys() >= {info.name for info in registry}
    choices = {element.get("ref") for element in root.findall(f"{XS}group[@name='node']/{XS}choice/{XS}element")}
    assert choices == elements.keys() - {"root", "BehaviorTree"}
    for info in registry:
        if info.kind == "SubTree":
            continue
        attributes = {one.get("name"): one for one in elements[info.name].iter(f"{XS}attribute")}
        assert attributes.keys() == info.ports.keys() - {"name"}
        assert {name for name, one in attributes.items() if one.get("use") == "required"} == {*info.required} - {"name"}
        below = elements[info.name].find(f"{XS}complexType/{XS}sequence/{XS}group")
        assert (below is None) == (info.max_children == 0)
        if below is not None:
            most = "unbounded" if info.max_children is None else str(info.max_children)
            assert (below.get("minOccurs"), below.get("maxOccurs")) == (str(info.min_children), most)


def test_ports_are_documented() -> None:
    root = ElementTree.fromstring(schema_xsd(NodeRegistry()))
    port = next(one for one in root.iter(f"{XS}attribute") if one.get("name") == "num_attempts")
    assert "".join(port.itertext()).startswith("input, int")
