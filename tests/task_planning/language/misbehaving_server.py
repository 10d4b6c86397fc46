"""A local server that speaks the chat-completions protocol, and misbehaves in the ways that it is told."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from typing import Any

from tests.answering_server import Handler, Server, Way, send, serving_at


def serving(*ways: Way) -> AbstractContextManager[Server]:
    """A server on this machine that answers so."""
    return serving_at("/v1/chat/completions", *ways)


def completion(message: dict[str, Any], finish: str = "stop") -> bytes:
    return json.dumps(
        {
            "id": "chatcmpl-1",
            "object": "chat.completion",
            "model": "test",
            "choices": [{"index": 0, "message": {"role": "assistant", **message}, "finish_reason": finish}],
            "usage": {"prompt_tokens": 1000, "completion_tokens": 50, "total_tokens": 1050},
        }
    ).encode()


def says(content: object) -> Way:
    """An answer: text as it is, anything else as JSON."""
    text = content if isinstance(content, str) else json.dumps(content)
    return lambda handler: send(handler, 200, completion({"content": text}))


def refuses(text: str) -> Way:
    """The refusal of structured outputs, beside the content."""
    return lambda handler: send(handler, 200, completion({"content": None, "refusal": text}))


def fails(status: int, text: str = "it broke", **headers: str) -> Way:
    return lambda handler: send(handler, status, json.dumps({"error": {"message": text}}).encode(), **headers)


def calls_a_tool(name: str, arguments: dict[str, Any]) -> Way:
    call = {"id": "call_1", "type": "function", "function": {"name": name, "arguments": json.dumps(arguments)}}
    return lambda handler: send(handler, 200, completion({"content": None, "tool_calls": [call]}, "tool_calls"))


def stops_at_length(content: object) -> Way:
    """The model reaches its limit of tokens in mid-answer."""
    text = json.dumps(content)
    return lambda handler: send(handler, 200, completion({"content": text[: len(text) // 2]}, "length"))


def without(field: str, then: Way) -> Way:
    """An older server, that refuses one of the optional fields."""

    def way(handler: Handler) -> None:
        if field in handler.server.questions[-1]:
            fails(400, f"Unrecognized request argument supplied: {field}")(handler)
        else:
            then(handler)

    return way
