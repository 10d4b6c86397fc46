"""The behavior-tree engine: BehaviorTree.CPP v4 semantics on py_trees classes."""

from __future__ import annotations

from py_trees.ports import PortInformation

from bestman_bt.engine.authoring import build_tree, load_python_tree
from bestman_bt.engine.blackboard import Blackboard, Entry
from bestman_bt.engine.clock import Clock, ManualClock, WakeableClock, WallClock
from bestman_bt.engine.controls import (
    AsyncFallback,
    AsyncSequence,
    Control,
    Fallback,
    IfThenElse,
    Parallel,
    ParallelAll,
    ReactiveFallback,
    ReactiveSequence,
    Sequence,
    SequenceWithMemory,
    WhileDoElse,
)
from bestman_bt.engine.conversion import ConverterRegistry
from bestman_bt.engine.decorators import (
    Decorator,
    Delay,
    ForceFailure,
    ForceSuccess,
    Inverter,
    KeepRunningUntilFailure,
    Repeat,
    RetryUntilSuccessful,
    SubTree,
    Timeout,
)
from bestman_bt.engine.errors import (
    BlackboardError,
    ConversionError,
    EngineError,
    NodeError,
    Problem,
    ScriptError,
    TreeLoadError,
)
from bestman_bt.engine.leaves import Condition, StatefulAction, SyncAction
from bestman_bt.engine.leaves.constants import AlwaysFailure, AlwaysSuccess
from bestman_bt.engine.leaves.native import PyTreesBehaviour
from bestman_bt.engine.leaves.script import Script, ScriptCondition
from bestman_bt.engine.leaves.sleep import Sleep
from bestman_bt.engine.loading import load_tree
from bestman_bt.engine.node import Node
from bestman_bt.engine.ports import Port
from bestman_bt.engine.registry import NodeInfo, NodeRegistry, RegistryError
from bestman_bt.engine.status import (
    FAILURE,
    IDLE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    NodeStatus,
    status_name,
)
from bestman_bt.engine.tree import Listener, StateChanges, Tree

__all__ = [
    "FAILURE",
    "IDLE",
    "RUNNING",
    "SKIPPED",
    "SUCCESS",
    "AlwaysFailure",
    "AlwaysSuccess",
    "AsyncFallback",
    "AsyncSequence",
    "Blackboard",
    "BlackboardError",
    "Clock",
    "Condition",
    "Control",
    "ConversionError",
    "ConverterRegistry",
    "Decorator",
    "Delay",
    "EngineError",
    "Entry",
    "Fallback",
    "ForceFailure",
    "ForceSuccess",
    "IfThenElse",
    "Inverter",
    "KeepRunningUntilFailure",
    "Listener",
    "ManualClock",
    "Node",
    "NodeError",
    "NodeInfo",
    "NodeRegistry",
    "NodeStatus",
    "Parallel",
    "ParallelAll",
    "Port",
    "PortInformation",
    "Problem",
    "PyTreesBehaviour",
    "ReactiveFallback",
    "ReactiveSequence",
    "RegistryError",
    "Repeat",
    "RetryUntilSuccessful",
    "Script",
    "ScriptCondition",
    "ScriptError",
    "Sequence",
    "SequenceWithMemory",
    "Sleep",
    "StateChanges",
    "StatefulAction",
    "SubTree",
    "SyncAction",
    "Timeout",
    "Tree",
    "TreeLoadError",
    "WakeableClock",
    "WallClock",
    "WhileDoElse",
    "build_tree",
    "load_python_tree",
    "load_tree",
    "status_name",
]
