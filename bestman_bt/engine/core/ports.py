"""Ports: declared on classes with py_trees' ``PortInformation``, merged along the inheritance, read and written here.

An attribute ``{key}`` maps a port to a blackboard entry (``{=}`` to the entry of the port's own name); any other value
is a literal. Literals are converted once, and entries are resolved to their slot once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, TypeVar, get_origin, overload

from py_trees.ports import PortInformation

from bestman_bt.engine.bounds import BoundedPort, describe_range, refusal
from bestman_bt.engine.conversion import UNTYPED, cast, type_name
from bestman_bt.engine.errors import BlackboardError, ConversionError, EngineError

if TYPE_CHECKING:
    from bestman_bt.engine.blackboard import Slot
    from bestman_bt.engine.core.node import Node


@dataclass(frozen=True, slots=True)
class Port:
    """One declared port; ``direction``: ``input``, ``output`` or ``inout``.

    ``required``: it must be given. ``strict``: an entry that it is mapped to must have a value, even if the port has a
    default. ``bounds``: bounds of the value; None: only its type. ``written_type``: the type as a file names it, for a
    port known only from a file.
    """

    name: str
    direction: str
    data_type: Any
    required: bool
    default: Any
    description: str
    strict: bool = False
    bounds: tuple[Any, ...] | None = None
    written_type: str = ""

    @property
    def type_name(self) -> str:
        """A readable name of the port's type."""
        return self.written_type or type_name(self.data_type)

    @property
    def accepts(self) -> str:
        """The type with its bounds, such as ``float from 0 to 1``."""
        return f"{self.type_name} {describe_range(self.bounds or ())}".rstrip()

    @property
    def default_in_words(self) -> str:
        """The default as text, such as ``default 0.5`` or ``default ''``; empty without a default."""
        return "" if self.default is None else f"default {str(self.default) or repr('')}"


def declared_ports(cls: type[Node]) -> dict[str, Port]:
    """Return the ports of a class, its bases' first; a name among inputs and outputs is one inout port."""
    inputs: dict[str, PortInformation] = {}
    outputs: dict[str, PortInformation] = {}
    for base in reversed(cls.__mro__):
        inputs.update(vars(base).get("INPUT_PORTS", {}))
        outputs.update(vars(base).get("OUTPUT_PORTS", {}))
    ports: dict[str, Port] = {}
    for name, information in {**inputs, **outputs}.items():
        if name in inputs:
            direction = "inout" if name in outputs else "input"
            information = inputs[name]
        else:
            direction = "output"
        ports[name] = Port(
            name,
            direction,
            information.data_type,
            information.required and not information.has_default,
            information.default_value,
            information.description,
            information.required,
            information.bounds if isinstance(information, BoundedPort) else None,
        )
    return ports


def outer_key_of(attribute: Any, port: str) -> str | None:
    """Return the outer key that a SubTree's attribute maps ``port`` to, or None for a literal; a bare ``=`` is a
    literal.
    """
    return None if attribute == "=" else key_of(attribute, port)


def key_of(attribute: Any, port: str) -> str | None:
    """Return the blackboard key that an attribute maps ``port`` to, or None for a literal."""
    if attribute.__class__ is not str or len(attribute) < 3:
        return port if attribute == "=" else None
    text = attribute if attribute[0] == "{" and attribute[-1] == "}" else attribute.strip(" ")
    if len(text) >= 3 and text[0] == "{" and text[-1] == "}" and "{" not in text[1:]:
        key = text[1:-1]
        return port if key == "=" else key
    return None


def make_reader(node: Node, name: str) -> Callable[[], Any]:
    """Return the function that reads an input port of a loaded node. Raises NodeError for an unknown port."""
    ports: Mapping[str, Port] = node.owner.info_of(node).ports
    port = ports.get(name)
    if port is None or port.direction == "output":
        known = ", ".join(p.name for p in ports.values() if p.direction != "output") or "none"
        raise node.error(f"it has no input port '{name}' (its input ports: {known})")
    attribute = node.attributes.get(name)
    if attribute is None:
        if port.required:
            raise node.error(f"port '{name}' is required but not given")
        default = port.default
        if isinstance(default, str) and key_of(default, name) is not None:
            attribute = default
        else:
            return lambda: default
    key = key_of(attribute, name)
    if key is None:
        return _constant(node, port, attribute)
    read = _entry_reader(node, port, node.board.slot(key), key)
    return read if port.bounds is None else _bounded(node, port, port.bounds, read)


def _constant(node: Node, port: Port, attribute: Any) -> Callable[[], Any]:
    try:
        value = cast(attribute, port.data_type, node.board.store.converters)
    except ConversionError as error:
        raise node.error(f"port '{port.name}': {error}") from error
    return lambda: value


def _entry_reader(node: Node, port: Port, slot: Slot, key: str) -> Callable[[], Any]:
    data_type = port.data_type
    converters = slot.store.converters
    untyped = data_type in UNTYPED
    exact = data_type if isinstance(data_type, type) else None
    # A default that names an entry is where the value comes from, and never the value.
    default = None if isinstance(port.default, str) and key_of(port.default, port.name) is not None else port.default

    def read() -> Any:
        value = slot.value
        if value is None:
            if port.strict:
                raise node.error(f"port '{port.name}': the entry '{{{key}}}' has no value yet")
            return default
        if untyped or value.__class__ is exact:
            return value
        try:
            return cast(value, data_type, converters)
        except ConversionError as error:
            raise node.error(f"port '{port.name}' from '{{{key}}}': {error}") from error

    return read


def _bounded(node: Node, port: Port, bounds: tuple[Any, ...], read: Callable[[], Any]) -> Callable[[], Any]:
    def read_within() -> Any:
        value = read()
        message = "" if value is None else refusal(value, bounds)
        if message:
            raise node.wrong_input(f"port '{port.name}': {message}")
        return value

    return read_within


def make_writer(node: Node, name: str) -> Callable[[Any], None]:
    """Return the function that writes an output port of a loaded node. Raises NodeError for an unknown port."""
    ports: Mapping[str, Port] = node.owner.info_of(node).ports
    port = ports.get(name)
    if port is None or port.direction == "input":
        known = ", ".join(p.name for p in ports.values() if p.direction != "input") or "none"
        raise node.error(f"it has no output port '{name}' (its output ports: {known})")
    attribute = node.attributes.get(name)
    if attribute is None and isinstance(port.default, str):
        attribute = port.default
    if attribute is None:
        return lambda value: None
    key = key_of(attribute, name)
    if key is None:
        return lambda value: None
    return _entry_writer(node, port, node.board.slot_to_write(key))


def _entry_writer(node: Node, port: Port, slot: Slot) -> Callable[[Any], None]:
    data_type = port.data_type
    converters = slot.store.converters
    untyped = data_type in UNTYPED

    def write(value: Any) -> None:
        try:
            if not untyped and value is not None:
                value = cast(value, data_type, converters)
            slot.assign(value, node)
        except (ConversionError, BlackboardError) as error:
            raise node.error(f"output port '{port.name}': {error}") from error

    return write


T = TypeVar("T")


class _Declared:
    """Base of all kinds of typed ports. ``port``: the port's name; by default that of the attribute."""

    def __init__(self, data_type: Any, text: str, default: Any, required: bool, port: str) -> None:
        self.port = port
        if isinstance(data_type, PortInformation):
            self.information = data_type
            return
        finite = data_type in (int, float) and default != math.inf  # then a value may be infinite, too
        bounded = finite or get_origin(data_type) is Annotated
        entry = (
            isinstance(default, str) and key_of(default, port) is not None
        )  # is of no type, and read or written instead
        kind = BoundedPort if bounded else PortInformation
        self.information = kind(data_type, required, text, None if entry else default)
        if entry:
            object.__setattr__(self.information, "default_value", default)  # it is frozen

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self.port = self.port or name


class In(_Declared, Generic[T]):
    """An input port; reading the attribute returns its value, converted and checked.

    ``data_type``: a type, or one with bounds, as ``In[float](Annotated[float, Gt(0)], …)``; numbers must be finite. Or
    py_trees' ``PortInformation``, as it is: a literal ``3x`` is then read as 3, as BehaviorTree.CPP does.
    ``default``: used if the port is not given; text such as ``"{start}"`` names an entry to read. ``required``: False
    without a default: the value is None if it is not given; True with a default: an entry that it is mapped to must
    have a value. ``port``: the port's name, if an attribute of that name would hide one of the node's.
    """

    @overload
    def __init__(self: In[T], data_type: type[T], text: str = "", /, *, port: str = "") -> None: ...
    @overload
    def __init__(
        self: In[T], data_type: type[T], text: str = "", /, *, default: T | str, required: bool = ..., port: str = ""
    ) -> None: ...
    @overload
    def __init__(
        self: In[T | None], data_type: type[T], text: str = "", /, *, required: Literal[False], port: str = ""
    ) -> None: ...
    @overload
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: Any = None, required: bool = ..., port: str = ""
    ) -> None: ...
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: Any = None, required: bool | None = None, port: str = ""
    ) -> None:
        super().__init__(data_type, text, default, default is None if required is None else required, port)

    @overload
    def __get__(self, node: None, owner: type[Any]) -> In[T]: ...
    @overload
    def __get__(self, node: Any, owner: type[Any]) -> T: ...
    def __get__(self, node: Any, owner: type[Any]) -> Any:
        return self if node is None else node.get_input(self.port)

    def __set__(self, node: Any, value: Any) -> None:
        raise AttributeError(f"{type(node).__name__}.{self.port} is an input port: it is read, not written")


class Out(_Declared, Generic[T]):
    """An output port; setting the attribute writes the mapped entry, if any.

    Arguments as for ``In``; ``default``: ``"{entry}"``, written if the port is not mapped. ``required``: it must be
    mapped.
    """

    @overload
    def __init__(
        self: Out[T], data_type: type[T], text: str = "", /, *, default: str = ..., required: bool = ..., port: str = ""
    ) -> None: ...
    @overload
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: str | None = ..., required: bool = ..., port: str = ""
    ) -> None: ...
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: str | None = None, required: bool = False, port: str = ""
    ) -> None:
        super().__init__(data_type, text, default, required, port)

    @overload
    def __get__(self, node: None, owner: type[Any]) -> Out[T]: ...
    @overload
    def __get__(self, node: Any, owner: type[Any]) -> T: ...
    def __get__(self, node: Any, owner: type[Any]) -> Any:
        if node is None:
            return self
        raise AttributeError(f"{type(node).__name__}.{self.port} is an output port: it is written, not read")

    def __set__(self, node: Any, value: T) -> None:
        node.set_output(self.port, value)


class InOut(_Declared, Generic[T]):
    """A port that is read and written. Arguments as for ``In``; an optional one without a value is None."""

    # As of In: type checkers see that an optional one may be None only where the overloads are of this class.
    @overload
    def __init__(
        self: InOut[T], data_type: type[T], text: str = "", /, *, default: T = ..., port: str = ""
    ) -> None: ...
    @overload
    def __init__(
        self: InOut[T | None], data_type: type[T], text: str = "", /, *, required: Literal[False], port: str = ""
    ) -> None: ...
    @overload
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: Any = None, required: bool = ..., port: str = ""
    ) -> None: ...
    def __init__(
        self, data_type: Any, text: str = "", /, *, default: Any = None, required: bool | None = None, port: str = ""
    ) -> None:
        super().__init__(data_type, text, default, default is None if required is None else required, port)

    @overload
    def __get__(self, node: None, owner: type[Any]) -> InOut[T]: ...
    @overload
    def __get__(self, node: Any, owner: type[Any]) -> T: ...
    def __get__(self, node: Any, owner: type[Any]) -> Any:
        return self if node is None else node.get_input(self.port)

    def __set__(self, node: Any, value: T) -> None:
        node.set_output(self.port, value)


def declare_typed_ports(cls: type[Any]) -> None:
    """Add the typed ports of a class to its ``INPUT_PORTS`` and ``OUTPUT_PORTS``.

    Raises EngineError if a port would hide an attribute of nodes.
    """
    typed = {name: value for name, value in vars(cls).items() if isinstance(value, _Declared)}
    for name, value in typed.items():
        hidden = next((base for base in cls.__mro__[1:] if name in vars(base)), None)
        if hidden is not None and not isinstance(vars(hidden)[name], _Declared):
            kind = type(value).__name__
            raise EngineError(
                f"the port {name!r} of {cls.__name__} would hide {hidden.__name__}.{name}; "
                f"give the attribute another name, as {name}_ = {kind}(…, port={name!r})"
            )
    for kinds, attribute in (((In, InOut), "INPUT_PORTS"), ((Out, InOut), "OUTPUT_PORTS")):
        found = {one.port: one.information for one in typed.values() if isinstance(one, kinds)}
        if found:
            setattr(cls, attribute, {**vars(cls).get(attribute, {}), **found})
