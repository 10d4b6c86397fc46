"""A key that is sent with each question and shown nowhere."""

from __future__ import annotations

import json

from bestman_bt.task_planning.language.errors import EndpointNotSetError


class ApiKey:
    """Knows how to sign a request and how to take itself out of texts; its ``repr`` tells nothing.

    Raises EndpointNotSetError, without the key, where it has characters that no HTTP header can carry: the libraries
    below would show the whole header in their error.
    """

    def __init__(self, text: str) -> None:
        text = text.strip()
        if not all("!" <= character <= "~" for character in text):
            raise EndpointNotSetError("the API key has characters other than visible ASCII")
        self._text = text

    def __bool__(self) -> bool:
        return bool(self._text)

    def __repr__(self) -> str:
        return "ApiKey(…)" if self._text else "ApiKey()"

    def headers(self) -> dict[str, str]:
        """The header ``Authorization``, if there is a key."""
        return {"Authorization": f"Bearer {self._text}"} if self._text else {}

    def removed_from(self, text: str) -> str:
        """The text with ``…`` wherever it quotes the key, plainly or in JSON, as servers do that do not know it."""
        if not self._text:
            return text
        quoted = json.dumps(self._text)[1:-1]
        for written in (quoted.replace("/", "\\/"), quoted, self._text):
            text = text.replace(written, "…")
        return text
