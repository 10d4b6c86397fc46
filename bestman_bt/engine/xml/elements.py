"""Secure XML parser (expat): elements with line numbers; dangerous constructs are refused.

Entities, external references and oversized input are refused early: a file has at most ``MAX_BYTES``, and elements nest
at most ``MAX_DEPTH`` deep, as in BehaviorTree.CPP. Constructs that TinyXML-2 accepts although they are not XML are also
accepted.
"""

from __future__ import annotations

import xml.parsers.expat
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.xml.tinyxml import AsXml
from bestman_bt.errors import Error

MAX_BYTES = 16_000_000
MAX_DEPTH = 256

NO_CHILDREN: Final[list[Any]] = []
"""Shared empty list of children of leaf elements; never modified."""


class Element:
    """One XML element.

    Checking it against the registry sets ``info`` of its node, the ``entries`` that its ports are mapped to as (port,
    key, data type), and whether it has its own ``scripts``. ``text`` is kept only inside a TreeNodesModel.
    """

    __slots__ = ("attributes", "children", "entries", "info", "line", "scripts", "tag", "text")

    def __init__(self, tag: str, attributes: dict[str, str], line: int) -> None:
        self.tag = tag
        self.attributes = attributes
        self.line = line
        self.children: list[Element] = NO_CHILDREN
        self.info: Any = None
        self.entries: list[tuple[str, str, Any]] | None = None
        self.scripts = False
        self.text = ""

    def iter(self) -> Iterator[Element]:
        """Yield this element and its descendants, in document order."""
        pending = [self]
        while pending:
            element = pending.pop()
            yield element
            pending.extend(reversed(element.children))


class Refused(Error):
    """Raised if the XML contains a construct that is refused on purpose."""

    def __init__(self, line: int, message: str) -> None:
        self.line = line
        super().__init__(message)


def parse_xml(text: str | bytes, file: str, report: Callable[[TreeProblem], None] | None = None) -> Element:
    """Return the root element of ``text``. ``report``: called with a warning for each place that is not valid XML.

    Raises:
        TreeLoadError: it is not well-formed XML, or contains a refused construct.
    """
    parser, data, tolerated = safe_parser(text, file)
    if report is not None:
        for line, what in tolerated:
            report(TreeProblem(file, line, "", "", what, severity="warning"))
    holder = Element("", {}, 0)
    stack = [holder]
    push, pop = stack.append, stack.pop

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber)
        parent = stack[-1]
        if parent.children:
            parent.children.append(element)
        else:
            parent.children = [element]
        push(element)
        if tag == "TreeNodesModel":
            parser.CharacterDataHandler = read_text
        if len(stack) > MAX_DEPTH + 4:
            raise Refused(element.line, f"elements are nested deeper than {MAX_DEPTH}")

    def end(tag: str) -> None:
        pop()
        if tag == "TreeNodesModel":
            parser.CharacterDataHandler = None

    def read_text(text: str) -> None:
        stack[-1].text += text

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    run_parser(parser, data, file)
    return holder.children[0]


def safe_parser(
    text: str | bytes, file: str
) -> tuple[xml.parsers.expat.XMLParserType, bytes, Sequence[tuple[int, str]]]:
    """Return an expat parser that refuses entities and external references, the bytes to feed it, and warnings.

    The bytes are those of ``text``; constructs that only TinyXML-2 accepts are converted to XML, and each gives a
    warning (line, fault), as does a file in UTF-16.

    Raises:
        TreeLoadError: the text is too long or contains NUL bytes.
    """
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    if len(data) > MAX_BYTES:
        raise _failure(file, 0, f"the file has {len(data)} bytes; at most {MAX_BYTES} are accepted")
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in data[:4096] and not wide:
        raise _failure(file, 1, "the file holds NUL bytes; it is not XML text")
    encoding = "utf-8" if isinstance(text, str) else None
    tolerated: Sequence[tuple[int, str]] = ((1, "not portable: BehaviorTree.CPP reads UTF-8"),) if wide else ()
    fault = None if wide else _fault_of(data, encoding)
    if fault is not None:
        as_xml = AsXml(data)
        later = _fault_of(as_xml.data, encoding)
        if later is None or later > fault:
            data, tolerated = as_xml.data, as_xml.places()
    return _refusing_parser(encoding), data, tolerated


def _refusing_parser(encoding: str | None) -> xml.parsers.expat.XMLParserType:
    parser = xml.parsers.expat.ParserCreate(encoding)
    parser.buffer_text = True

    def entity(name: str, *rest: Any) -> None:
        raise Refused(parser.CurrentLineNumber, f"entity declarations are refused ('{name}')")

    def doctype(name: str, system_id: str | None, public_id: str | None, internal: int) -> None:
        if system_id or public_id:
            raise Refused(parser.CurrentLineNumber, f"external references are refused ('{system_id or public_id}')")

    def external(*rest: Any) -> int:
        raise Refused(parser.CurrentLineNumber, "external references are refused")

    parser.EntityDeclHandler = entity
    parser.StartDoctypeDeclHandler = doctype
    parser.ExternalEntityRefHandler = external
    return parser


def _fault_of(data: bytes, encoding: str | None) -> tuple[int, int] | None:
    """Return line and column at which ``data`` is not well-formed, or None."""
    try:
        _refusing_parser(encoding).Parse(data, True)
    except xml.parsers.expat.ExpatError as error:
        return error.lineno, error.offset
    except (Refused, LookupError, ValueError):
        pass  # reported where the file is read
    return None


def run_parser(parser: xml.parsers.expat.XMLParserType, data: bytes, file: str) -> None:
    """Feed ``data`` to a parser.

    Raises:
        TreeLoadError: the data is not well-formed XML, or contains a refused construct.
    """
    try:
        parser.Parse(data, True)
    except Refused as refused:
        raise _failure(file, refused.line, str(refused)) from None
    except xml.parsers.expat.ExpatError as error:
        what = xml.parsers.expat.errors.messages[error.code]
        message = f"not well-formed XML: {what} (column {error.offset + 1})"
        raise _failure(file, error.lineno, message) from None
    except (LookupError, ValueError, UnicodeError) as error:
        raise _failure(file, parser.CurrentLineNumber, f"not readable as XML: {error}") from None


def _failure(file: str, line: int, message: str) -> TreeLoadError:
    return TreeLoadError([TreeProblem(file, line, "", "", message)])
