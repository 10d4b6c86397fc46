"""The script language of BehaviorTree.CPP v4: tokens, a Pratt parser, and closures on blackboard slots."""

from __future__ import annotations

from bestman_bt.engine.scripting.compiler import ScriptCompiler
from bestman_bt.engine.scripting.parser import (
    MAX_SCRIPT_DEPTH,
    MAX_SCRIPT_LENGTH,
    assigns_to_no_key,
    parse_script,
    tokenize,
)

__all__ = [
    "MAX_SCRIPT_DEPTH",
    "MAX_SCRIPT_LENGTH",
    "ScriptCompiler",
    "assigns_to_no_key",
    "parse_script",
    "tokenize",
]
