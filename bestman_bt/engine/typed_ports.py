"""Ports as typed attributes of a node: ``goal = In(Pose2D, "where to drive")``, then ``self.goal`` is a ``Pose2D``."""

from __future__ import annotations

import math
from typing import Annotated, Any, Generic, Literal, TypeVar, get_origin, overload

from py_trees.ports import PortInformation

from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.ports import key_of

T = TypeVar("T")


class _Declared:
    """What all kinds of typed ports share. ``port``: the port's name; by default that of the attribute."""

    def __init__(self, data_type: Any, text: str, default: Any, required: bool, port: str) -> None:
        finite = data_type in (int, float) and default != math.inf  # then a value may be infinite, too
        bounded = finite or get_origin(data_type) is Annotated
        entry = (
            isinstance(default, str) and key_of(default, port) is not None
        )  # is of no type, and read or written instead
        kind = BoundedPort if bounded else PortInformation
        self.information = kind(data_type, required, text, None if entry else default)
        if entry:
            object.__setattr__(self.information, "default_value", default)  # it is frozen
        self.port = port

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self.port = self.port or name


class In(_Declared, Generic[T]):
    """An input port; reading the attribute gives its value, converted and checked.

    ``data_type``: a type, or one with bounds, as ``In[float](Annotated[float, Gt(0)], …)``; numbers are finite.
    ``default``: what it is where it is not given; text such as ``"{start}"`` names the entry that is read then.
    ``required``: False without a default: it is None where it is not given; True with one: an entry that it is mapped
    to must have a value. ``port``: the port's name, where an attribute of that name would hide one of the node's.
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
    """An output port; setting the attribute writes the entry that it is mapped to, if it is mapped.

    Arguments as of ``In``; ``default``: ``"{entry}"`` that is written where it is not mapped.
    ``required``: it has to be mapped.
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
    """A port that is read and written. Arguments as of ``In``; without a value an optional one is None."""

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
    """Put the typed ports of a class among its ``INPUT_PORTS`` and ``OUTPUT_PORTS``.

    EngineError where one would hide an attribute that nodes have.
    """
    typed = {name: value for name, value in vars(cls).items() if isinstance(value, _Declared)}
    for name, value in typed.items():
        hidden = next((base for base in cls.__mro__[1:] if name in vars(base)), None)
        if hidden is not None and not isinstance(vars(hidden)[name], _Declared):
            kind = type(value).__name__
            raise EngineError(
                f"the port {name!r} of {cls.__name__} would hide {hidden.__name__}.{name}: "
                f"give the attribute another name, as {name}_ = {kind}(…, port={name!r})"
            )
    for kinds, attribute in (((In, InOut), "INPUT_PORTS"), ((Out, InOut), "OUTPUT_PORTS")):
        found = {one.port: one.information for one in typed.values() if isinstance(one, kinds)}
        if found:
            setattr(cls, attribute, {**vars(cls).get(attribute, {}), **found})
