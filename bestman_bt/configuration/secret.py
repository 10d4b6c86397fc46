"""Texts that never appear in messages, logs or files: addresses and tokens of controllers."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

_TELLING = re.compile(r"connect|addr|token|passw|secret", re.IGNORECASE)


@dataclass(frozen=True)
class SecretMark:
    """Marks a type whose values are never shown."""


Secret = Annotated[str, SecretMark()]


def is_secret_setting(key: str) -> bool:
    """Return whether messages and files hide the value of the ``--set`` option with this key."""
    return _TELLING.search(key) is not None


def shown_setting(setting: str) -> str:
    """Return ``key=value`` of a ``--set`` option for messages, without a value that may be secret."""
    key, equals, _ = setting.partition("=")
    telling = _TELLING.search(key)
    if telling is None:
        return f"--set {setting}"
    return f"--set {key}=…" if equals else f"--set {key[: telling.end()]}…"
