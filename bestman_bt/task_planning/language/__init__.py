"""Language models as planners: an instruction in words goes in, a checked plan comes out, or a refusal in words."""

from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatReply, ChatRequest, Message, Usage
from bestman_bt.task_planning.language.endpoint import EndpointAddress, EndpointLimits, HttpEndpoint
from bestman_bt.task_planning.language.errors import (
    EndpointNotSetError,
    EndpointReplyError,
    EndpointUnreachableError,
    LanguageError,
    ModelRefusedError,
    NoValidAnswerError,
    TranscriptError,
)
from bestman_bt.task_planning.language.from_text import GoalReader, LanguagePlanner, Proposal, plan_from_text
from bestman_bt.task_planning.language.transcripts import RecordingEndpoint, ReplayEndpoint

__all__ = [
    "ChatEndpoint",
    "ChatReply",
    "ChatRequest",
    "EndpointAddress",
    "EndpointLimits",
    "EndpointNotSetError",
    "EndpointReplyError",
    "EndpointUnreachableError",
    "GoalReader",
    "HttpEndpoint",
    "LanguageError",
    "LanguagePlanner",
    "Message",
    "ModelRefusedError",
    "NoValidAnswerError",
    "Proposal",
    "RecordingEndpoint",
    "ReplayEndpoint",
    "TranscriptError",
    "Usage",
    "plan_from_text",
]
