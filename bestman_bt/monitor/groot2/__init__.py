"""Groot2's live protocol over a running tree; needs the extra ``groot2``."""

from bestman_bt.monitor.groot2.protocol import DEFAULT_PORT, Groot2Error
from bestman_bt.monitor.groot2.publisher import Groot2Publisher, check_servable

__all__ = ["DEFAULT_PORT", "Groot2Error", "Groot2Publisher", "check_servable"]
