"""Numbers with a range, for the parameters of algorithms: wrong ones are refused where a configuration is read.

The types say what a value may be and cost nothing at run time. Every number of a configuration has to be finite, so no
type says that.
"""

from __future__ import annotations

import typing
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from bestman_bt.errors import Error

Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
PositiveShare = Annotated[float, Gt(0), Le(1)]
WholeNumber = Annotated[int, Ge(0)]
Count = Annotated[int, Ge(1)]
Several = Annotated[int, Ge(2)]


@dataclass(frozen=True)
class NotBelow:
    """Annotates a number that should not be smaller than that of ``field``: ``Annotated[float, NotBelow("least")]``."""

    field: str


class OrderError(Error, ValueError):
    """Two ``fields`` are each right, and wrong together."""

    def __init__(self, message: str, fields: tuple[str, str]) -> None:
        super().__init__(message)
        self.fields = fields


def check_bounds(parameters: object) -> None:
    """OrderError where a field of a dataclass is smaller than the one that its ``NotBelow`` names."""
    for name, hint in typing.get_type_hints(type(parameters), include_extras=True).items():
        for mark in getattr(hint, "__metadata__", ()):
            if not isinstance(mark, NotBelow):
                continue
            least, value = getattr(parameters, mark.field), getattr(parameters, name)
            if least > value:
                message = f"{mark.field} ({least:g}) should not be larger than {name} ({value:g})"
                raise OrderError(message, (mark.field, name))
