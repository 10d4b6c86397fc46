"""The exact text of a tree file: elements, comments, text and order, to change a part or write its normal form."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from bestman_bt.engine.xml.documents import read_file
from bestman_bt.engine.xml.elements import MAX_DEPTH, Refused, run_parser, safe_parser
from bestman_bt.engine.xml.writer import XmlError, escape


@dataclass
class XmlComment:
    """``<!--text-->``."""

    text: str


@dataclass
class XmlInstruction:
    """``<?target text?>``."""

    target: str
    text: str


@dataclass
class XmlText:
    """Text between elements; ``verbatim``: it is in a CDATA section."""

    text: str
    verbatim: bool = False


@dataclass
class XmlElement:
    """An element: its attributes in order, and its content in order."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    content: list[XmlItem] = field(default_factory=list)
    line: int = 0

    @property
    def children(self) -> list[XmlElement]:
        """The child elements."""
        return [item for item in self.content if isinstance(item, XmlElement)]

    def iter(self) -> Iterator[XmlElement]:
        """Yield this element and its descendants, in document order."""
        yield self
        for child in self.children:
            yield from child.iter()


XmlItem = XmlElement | XmlComment | XmlInstruction | XmlText


@dataclass
class XmlDocument:
    """A whole file; ``declaration``: the text after ``<?xml``, empty without one."""

    content: list[XmlItem] = field(default_factory=list)
    declaration: str = ""

    @property
    def root(self) -> XmlElement:
        """The outermost element."""
        return next(item for item in self.content if isinstance(item, XmlElement))

    @classmethod
    def parse(cls, text: str | bytes, file: str = "<text>") -> XmlDocument:
        """Parse XML.

        Raises:
            TreeLoadError: it is not well-formed, or contains a refused construct.
        """
        return _DocumentReader(file).read(text)

    @classmethod
    def load(cls, path: str | Path) -> XmlDocument:
        """Read a file.

        Raises:
            TreeLoadError: it does not exist, is not well-formed, or contains a refused construct.
        """
        return cls.parse(read_file(Path(path), str(path)), str(path))

    def to_xml(self) -> str:
        """Return the document as text, with white space, comments and order unchanged."""
        parts: list[str] = []
        if self.declaration:
            parts.append(f"<?xml {self.declaration}?>\n")
        for item in self.content:
            _write(item, parts)
            if not isinstance(item, XmlText):
                parts.append("\n")
        return "".join(parts)


def _write(item: XmlItem, parts: list[str]) -> None:
    if isinstance(item, XmlComment):
        if "--" in item.text or item.text.endswith("-"):
            raise XmlError(f"a comment cannot hold '--' or end with '-': {item.text[:60]!r}")
        parts.append(f"<!--{item.text}-->")
    elif isinstance(item, XmlInstruction):
        parts.append(f"<?{item.target} {item.text}?>" if item.text else f"<?{item.target}?>")
    elif isinstance(item, XmlText):
        if item.verbatim:
            parts.append(f"<![CDATA[{item.text.replace(']]>', ']]]]><![CDATA[>')}]]>")
        else:
            parts.append(escape_text(item.text))
    else:
        attributes = "".join(f' {name}="{escape(value)}"' for name, value in item.attributes.items())
        if not item.content:
            parts.append(f"<{item.tag}{attributes}/>")
            return
        parts.append(f"<{item.tag}{attributes}>")
        for inner in item.content:
            _write(inner, parts)
        parts.append(f"</{item.tag}>")


def escape_text(text: str) -> str:
    """Return ``text`` escaped for use between tags."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\r", "&#13;")


class _DocumentReader:
    def __init__(self, file: str) -> None:
        self.file = file
        self.document = XmlDocument()
        self.stack: list[XmlElement] = []
        self.verbatim = False

    def read(self, text: str | bytes) -> XmlDocument:
        parser, data, _ = safe_parser(text, self.file)
        parser.ordered_attributes = True
        parser.XmlDeclHandler = self._declaration
        parser.EndElementHandler = lambda tag: self.stack.pop()
        parser.CommentHandler = lambda comment: self._add(XmlComment(comment))
        parser.ProcessingInstructionHandler = lambda target, rest: self._add(XmlInstruction(target, rest))
        parser.CharacterDataHandler = self._text
        parser.StartCdataSectionHandler = self._start_verbatim
        parser.EndCdataSectionHandler = self._end_verbatim

        def start(tag: str, attributes: list[str]) -> None:
            if len(self.stack) > MAX_DEPTH + 4:
                raise Refused(parser.CurrentLineNumber, f"elements are nested deeper than {MAX_DEPTH}")
            pairs = dict(zip(attributes[::2], attributes[1::2], strict=True))
            element = XmlElement(tag, pairs, line=parser.CurrentLineNumber)
            self._add(element)
            self.stack.append(element)

        parser.StartElementHandler = start
        run_parser(parser, data, self.file)
        return self.document

    def _add(self, item: XmlItem) -> None:
        (self.stack[-1].content if self.stack else self.document.content).append(item)

    def _declaration(self, version: str, encoding: str | None, standalone: int) -> None:
        self.document.declaration = f'version="{version}" encoding="UTF-8"'

    def _start_verbatim(self) -> None:
        self.verbatim = True
        self._add(XmlText("", verbatim=True))

    def _end_verbatim(self) -> None:
        self.verbatim = False

    def _text(self, text: str) -> None:
        content = self.stack[-1].content
        last = content[-1] if content else None
        if isinstance(last, XmlText) and last.verbatim == self.verbatim:
            last.text += text
        else:
            content.append(XmlText(text, self.verbatim))


# The canonical form of a tree file, for rewriting it in a normal form: UTF-8 with a declaration, four spaces per level,
# one element or comment per line, double quotes, one space between attributes, ``<A/>`` for empty elements. Order,
# comments, names and values are preserved; text between elements stays on one line with its element.


def canonical(document: XmlDocument) -> str:
    """Return a document in its canonical form."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    for item in document.content:
        _write_lines(item, 0, lines)
    return "\n".join(lines) + "\n"


def _write_lines(item: XmlItem, depth: int, lines: list[str]) -> None:
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
            _write_lines(item, depth + 1, lines)
        lines.append(f"{lead}</{element.tag}>")
