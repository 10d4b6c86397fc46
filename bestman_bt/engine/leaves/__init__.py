"""Leaves: the base classes that skills derive from, and the built-in actions and conditions."""

from __future__ import annotations

from bestman_bt.engine.leaves.base import Condition, Leaf, StatefulAction, SyncAction

__all__ = ["Condition", "Leaf", "StatefulAction", "SyncAction"]
