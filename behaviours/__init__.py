"""Skill leaves of bestman-bt."""

from __future__ import annotations

from typing import TYPE_CHECKING

if not TYPE_CHECKING:

    def __getattr__(name):
        """Raise an error that names the module of a skill."""
        from bestman_bt.engine.own_files import raise_missing_name

        raise_missing_name(__name__, name)
