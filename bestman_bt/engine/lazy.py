"""An attribute that is made when somebody first reads it, and is an ordinary attribute from then on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Lazy:
    """Non-data descriptor: ``__getattr__`` would do the same but switches off CPython's attribute caches."""

    def __init__(self, make: Callable[[Any], Any]) -> None:
        self._make = make
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        value = self._make(instance)
        setattr(instance, self._name, value)
        return value
