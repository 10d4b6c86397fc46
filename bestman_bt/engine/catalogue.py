"""The built-in nodes, which every registry contains."""

from __future__ import annotations

from typing import Final

from bestman_bt.engine import controls, decorators
from bestman_bt.engine.core.registry import BUILTIN_NODES
from bestman_bt.engine.leaves.base import AlwaysFailure, AlwaysSuccess, Sleep
from bestman_bt.engine.leaves.blackboard import PopFromQueue, QueueSize, SetBlackboard, UnsetBlackboard, WasEntryUpdated
from bestman_bt.engine.leaves.script import Script, ScriptCondition

_LEAVES: Final = (
    AlwaysFailure,
    AlwaysSuccess,
    PopFromQueue,
    QueueSize,
    Script,
    ScriptCondition,
    SetBlackboard,
    Sleep,
    UnsetBlackboard,
    WasEntryUpdated,
)

_FAMILIES: Final = [
    getattr(family, name)
    for family in (controls, decorators)
    for name in family.__all__
    if name not in ("Control", "Decorator")
]

BUILTIN_NODES.update((cls.__name__, cls) for cls in (*_FAMILIES, *_LEAVES))

EXTENSIONS: Final = frozenset((
    "ConsumeQueue", "ForEach", "ManualSelector", "PipelineSequence", "PopFromQueue", "QueueSize", "RateController",
    "RecoveryNode", "RoundRobin",
))  # fmt: skip
"""Built-in nodes that BehaviorTree.CPP 4 does not provide by itself."""
