"""The behavior-tree engine: BehaviorTree.CPP v4 semantics on py_trees classes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from py_trees.ports import PortInformation

import bestman_bt.engine.catalogue  # noqa: F401 - fills the table of built-in nodes
from bestman_bt.engine.authoring import build_tree
from bestman_bt.engine.blackboard import Blackboard, Entry
from bestman_bt.engine.bounds import BoundedPort, NotZero, OneOf
from bestman_bt.engine.building import NoMainTree
from bestman_bt.engine.clock import EngineClock, ManualClock, WakeableClock, WallClock
from bestman_bt.engine.controls import (
    AsyncFallback,
    AsyncSequence,
    Control,
    Fallback,
    IfThenElse,
    ManualSelector,
    Parallel,
    ParallelAll,
    PipelineSequence,
    ReactiveFallback,
    ReactiveSequence,
    RecoveryNode,
    RoundRobin,
    Sequence,
    SequenceWithMemory,
    Switch2,
    Switch3,
    Switch4,
    Switch5,
    Switch6,
    TryCatch,
    WhileDoElse,
)
from bestman_bt.engine.conversion import ConverterRegistry
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import In, InOut, Out, Port
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry, RegistryError
from bestman_bt.engine.core.tree import Listener, StateChanges, Tree
from bestman_bt.engine.dataflow import EntryUse, entry_uses, render_ports
from bestman_bt.engine.decorators import (
    ConsumeQueue,
    Decorator,
    Delay,
    ForceFailure,
    ForceSuccess,
    ForEach,
    Inverter,
    KeepRunningUntilFailure,
    LoopBool,
    LoopDouble,
    LoopInt,
    LoopString,
    Precondition,
    RateController,
    Repeat,
    RetryUntilSuccessful,
    RunOnce,
    SkipUnlessUpdated,
    SubTree,
    Timeout,
    WaitValueUpdate,
)
from bestman_bt.engine.errors import (
    BlackboardError,
    ConversionError,
    EngineError,
    NodeError,
    ScriptError,
    TreeLoadError,
    TreeProblem,
)
from bestman_bt.engine.graphics import current_states, render_dot, render_paths, render_svg, render_text
from bestman_bt.engine.leaves.base import AlwaysFailure, AlwaysSuccess, Condition, Sleep, StatefulAction, SyncAction
from bestman_bt.engine.leaves.blackboard import PopFromQueue, QueueSize, SetBlackboard, UnsetBlackboard, WasEntryUpdated
from bestman_bt.engine.leaves.coroutine import CoroutineAction, ThreadedAction
from bestman_bt.engine.leaves.function import Context, FunctionLeafError, Output, action, condition
from bestman_bt.engine.leaves.native import PyTreesBehaviour
from bestman_bt.engine.leaves.script import Script, ScriptCondition, TestNode, TestNodeConfig
from bestman_bt.engine.loading import load_python_tree, load_tree
from bestman_bt.engine.own_files import raise_missing_name
from bestman_bt.engine.simulation import SimulatedRun, simulate
from bestman_bt.engine.snapshot import BlackboardBackup, backup, from_json, restore, to_json
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, NodeStatus, status_name
from bestman_bt.engine.substitution import SubstitutionError, SubstitutionRules
from bestman_bt.engine.validation import ineffective_parts, tree_warnings, validate_file
from bestman_bt.engine.xml.document import XmlDocument, XmlElement
from bestman_bt.engine.xml.writer import full_tree_xml, palette_xml, tree_to_xml

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
    "BlackboardBackup",
    "BlackboardError",
    "BoundedPort",
    "Condition",
    "ConsumeQueue",
    "Context",
    "Control",
    "ConversionError",
    "ConverterRegistry",
    "CoroutineAction",
    "Decorator",
    "Delay",
    "EngineClock",
    "EngineError",
    "Entry",
    "EntryUse",
    "Fallback",
    "ForEach",
    "ForceFailure",
    "ForceSuccess",
    "FunctionLeafError",
    "IfThenElse",
    "In",
    "InOut",
    "Inverter",
    "KeepRunningUntilFailure",
    "Listener",
    "LoopBool",
    "LoopDouble",
    "LoopInt",
    "LoopString",
    "ManualClock",
    "ManualSelector",
    "NoMainTree",
    "Node",
    "NodeError",
    "NodeInfo",
    "NodeRegistry",
    "NodeStatus",
    "NotZero",
    "OneOf",
    "Out",
    "Output",
    "Parallel",
    "ParallelAll",
    "PipelineSequence",
    "PopFromQueue",
    "Port",
    "PortInformation",
    "Precondition",
    "PyTreesBehaviour",
    "QueueSize",
    "RateController",
    "ReactiveFallback",
    "ReactiveSequence",
    "RecoveryNode",
    "RegistryError",
    "Repeat",
    "RetryUntilSuccessful",
    "RoundRobin",
    "RunOnce",
    "Script",
    "ScriptCondition",
    "ScriptError",
    "Sequence",
    "SequenceWithMemory",
    "SetBlackboard",
    "SimulatedRun",
    "SkipUnlessUpdated",
    "Sleep",
    "StateChanges",
    "StatefulAction",
    "SubTree",
    "SubstitutionError",
    "SubstitutionRules",
    "Switch2",
    "Switch3",
    "Switch4",
    "Switch5",
    "Switch6",
    "SyncAction",
    "TestNode",
    "TestNodeConfig",
    "ThreadedAction",
    "Timeout",
    "Tree",
    "TreeLoadError",
    "TreeProblem",
    "TryCatch",
    "UnsetBlackboard",
    "WaitValueUpdate",
    "WakeableClock",
    "WallClock",
    "WasEntryUpdated",
    "WhileDoElse",
    "XmlDocument",
    "XmlElement",
    "action",
    "backup",
    "build_tree",
    "condition",
    "current_states",
    "entry_uses",
    "from_json",
    "full_tree_xml",
    "ineffective_parts",
    "load_python_tree",
    "load_tree",
    "palette_xml",
    "render_dot",
    "render_paths",
    "render_ports",
    "render_svg",
    "render_text",
    "restore",
    "simulate",
    "status_name",
    "to_json",
    "tree_to_xml",
    "tree_warnings",
    "validate_file",
]


if not TYPE_CHECKING:

    def __getattr__(name):
        """Raise an error with a skill's module if the skill is looked up among the engine's nodes."""
        raise_missing_name(__name__, name)
