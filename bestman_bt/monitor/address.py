"""Where a monitor is found, and what it says it is."""

from __future__ import annotations

from urllib.parse import quote

SERVICE = "bestman-bt monitor"
"""What ``/health`` tells everybody."""
TOKEN_VARIABLE = "BESTMAN_BT_MONITOR_TOKEN"
"""Of the environment: a token on the command line is seen by all users of the machine."""


def page_address(host: str, port: int, token: str | None) -> str:
    """The address that opens the page."""
    query = f"?token={quote(token, safe='')}" if token else ""
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/{query}"
