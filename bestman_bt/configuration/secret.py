"""Texts that no message, log or file shows: addresses and tokens of controllers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

_TELLING = re.compile(r"connect|addr|token|passw|secret", re.IGNORECASE)


@dataclass(frozen=True)
class SecretMark:
    """Marks a type whose values are never shown."""


Secret = Annotated[str, SecretMark()]


def may_tell_secret(key: str) -> bool:
    """Return whether the value of an option ``--set`` with that key is left out of messages and files."""
    return _TELLING.search(key) is not None


def shown_setting(setting: str) -> str:
    """``key=value`` of an option ``--set`` for messages: the value of a key that may tell a secret is left out."""
    key, equals, _ = setting.partition("=")
    telling = _TELLING.search(key)
    if telling is None:
        return f"--set {setting}"
    return f"--set {key}=…" if equals else f"--set {key[: telling.end()]}…"
