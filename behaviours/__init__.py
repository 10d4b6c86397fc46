"""Skill leaves of bestman-bt."""

from __future__ import annotations

from typing import TYPE_CHECKING

if not TYPE_CHECKING:

    def __getattr__(name):
        """Tell which module has a skill."""
        from bestman_bt.engine.own_files import import_elsewhere

        import_elsewhere(__name__, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
