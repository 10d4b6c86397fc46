"""The canonical form of a tree file, for rewriting it in a normal form.

UTF-8 with a declaration, four spaces per level, one element or comment per line, double quotes, one space between
attributes, ``<A/>`` for empty elements. Order, comments, names and values are preserved; text between elements stays on
one line with its element.
"""

from __future__ import annotations

from bestman_bt.engine.xml.document import (
    XmlComment,
    XmlDocument,
    XmlElement,
    XmlInstruction,
    XmlItem,
    XmlText,
    escape_text,
)
from bestman_bt.engine.xml.writer import escape


def canonical(document: XmlDocument) -> str:
    """Return a document in its canonical form."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    for item in document.content:
        _write(item, 0, lines)
    return "\n".join(lines) + "\n"


def _write(item: XmlItem, depth: int, lines: list[str]) -> None:
    lead = "    " * depth
    if isinstance(item, XmlComment):
        lines.append(f"{lead}<!--{item.text}-->")
    elif isinstance(item, XmlInstruction):
        lines.append(f"{lead}<?{item.target} {item.text}?>")
    elif isinstance(item, XmlText):
        if item.text.strip():
            lines.append(lead + escape_text(item.text.strip()))
    else:
        _write_element(item, lead, depth, lines)


def _write_element(element: XmlElement, lead: str, depth: int, lines: list[str]) -> None:
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in element.attributes.items())
    inner = [item for item in element.content if not isinstance(item, XmlText) or item.text.strip()]
    if not inner:
        lines.append(f"{lead}<{element.tag}{attributes}/>")
    elif all(isinstance(item, XmlText) for item in inner):
        text = "".join(escape_text(item.text) for item in inner if isinstance(item, XmlText)).strip()
        lines.append(f"{lead}<{element.tag}{attributes}>{text}</{element.tag}>")
    else:
        lines.append(f"{lead}<{element.tag}{attributes}>")
        for item in inner:
            _write(item, depth + 1, lines)
        lines.append(f"{lead}</{element.tag}>")
