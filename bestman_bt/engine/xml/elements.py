"""Secure XML parser (expat): elements with line numbers; dangerous constructs are refused.

Entities, external references and oversized input are refused early: a file has at most ``MAX_BYTES``, and elements nest
at most ``MAX_DEPTH`` deep, as in BehaviorTree.CPP. Text that is not XML but that BehaviorTree.CPP's parser (TinyXML-2)
accepts, such as ``code="a < b && c"``, is accepted, too.
"""

from __future__ import annotations

import re
import xml.parsers.expat
from collections.abc import Callable, Iterator
from typing import Any, Final

from bestman_bt.engine.errors import TreeLoadError, TreeProblem
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
    """The XML contains a construct that is refused on purpose."""

    def __init__(self, line: int, message: str) -> None:
        self.line = line
        super().__init__(message)


def parse_xml(text: str | bytes, file: str, report: Callable[[TreeProblem], None] | None = None) -> Element:
    """Return the root element of ``text``. ``report``: called with a warning for what only TinyXML-2 accepts.

    Raises:
        TreeLoadError: it is not well-formed XML, or contains a refused construct.
    """
    parser, data = safe_parser(text, file)
    if report is not None:
        _report_tolerated(text, data, file, report)
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


def safe_parser(text: str | bytes, file: str) -> tuple[xml.parsers.expat.XMLParserType, bytes]:
    """Return an expat parser that refuses entities and external references, and the bytes to feed it.

    The bytes are those of ``text``, or as XML where only TinyXML-2 accepts it, with each line where it was.

    Raises:
        TreeLoadError: the text is too long or contains NUL bytes.
    """
    data = _bytes_of(text)
    if len(data) > MAX_BYTES:
        raise _failure(file, 0, f"the file has {len(data)} bytes; at most {MAX_BYTES} are accepted")
    if b"\0" in data[:4096] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise _failure(file, 1, "the file holds NUL bytes; it is not XML text")
    encoding = "utf-8" if isinstance(text, str) else None
    if not _is_well_formed(data, encoding):
        as_xml = _as_xml(data)
        data = as_xml if _is_well_formed(as_xml, encoding) else data
    return _refusing_parser(encoding), data


def _bytes_of(text: str | bytes) -> bytes:
    return text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text


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


def _is_well_formed(data: bytes, encoding: str | None) -> bool:
    try:
        _refusing_parser(encoding).Parse(data, True)
    except xml.parsers.expat.ExpatError:
        return False
    except (Refused, LookupError, ValueError):
        return True  # reported where the file is read
    return True


_PIECES: Final = re.compile(
    rb"""(?P<comment><!--.*?(?:-->|\Z)) | <!\[CDATA\[.*?(?:\]\]>|\Z) | <\?.*?(?:\?>|\Z)
    | (?P<name><[^\s<>/"'=!?]+) (?P<attributes>\s(?:\s*[^\s<>/"'=]+\s*=\s*(?:"[^"]*"|'[^']*'))+)
    | &""",
    re.DOTALL | re.VERBOSE,
)
_ATTRIBUTE: Final = re.compile(rb"""(\s*)([^\s<>/"'=]+\s*=\s*)("[^"]*"|'[^']*')""")
_BARE_AMPERSAND: Final = re.compile(rb"&(?!(?:\#[0-9]+|\#x[0-9a-fA-F]+|amp|lt|gt|quot|apos);)")


def _as_xml(data: bytes) -> bytes:
    """Return what TinyXML-2 accepts as XML: a bare ``&``, ``<`` in a value, no space between attributes, ``--`` within
    a comment.
    """
    return _PIECES.sub(_piece_as_xml, data)


def _piece_as_xml(piece: re.Match[bytes]) -> bytes:
    if piece["attributes"]:
        return piece["name"] + _ATTRIBUTE.sub(_attribute_as_xml, piece["attributes"])
    if piece["comment"] and piece[0].endswith(b"-->") and len(piece[0]) >= len(b"<!---->"):
        inner = re.sub(rb"-(?=-|\Z)", b"- ", piece[0][len(b"<!--") : -len(b"-->")])
        return b"<!--" + inner + b"-->"
    if piece[0] == b"&":
        found = _BARE_AMPERSAND.match(piece.string, piece.start())
        return b"&amp;" if found else b"&"
    return piece[0]


def _attribute_as_xml(attribute: re.Match[bytes]) -> bytes:
    space, name, value = attribute.groups()
    return (space or b" ") + name + _BARE_AMPERSAND.sub(b"&amp;", value).replace(b"<", b"&lt;")


def _report_tolerated(text: str | bytes, data: bytes, file: str, report: Callable[[TreeProblem], None]) -> None:
    """Report the first line in which ``data`` is not as written."""
    if data == _bytes_of(text):
        return
    pairs = zip(_bytes_of(text).split(b"\n"), data.split(b"\n"), strict=True)
    lines = [number for number, (before, after) in enumerate(pairs, 1) if before != after]
    more = f" (lines like this: {len(lines)})" if len(lines) > 1 else ""
    what = f"only BehaviorTree.CPP accepts this as XML; write &amp; for &, &lt; for <, and no -- in comments{more}"
    report(TreeProblem(file, lines[0], "", "", what, severity="warning"))


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
