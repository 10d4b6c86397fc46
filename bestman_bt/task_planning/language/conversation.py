"""The dialogue loop: ask, check, report the faults, ask again, a bounded number of times."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from pydantic import ValidationError

from bestman_bt.errors import Error
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatReply, ChatRequest, Message, Usage
from bestman_bt.task_planning.language.errors import ModelRefusedError, NoValidAnswerError, quoted
from bestman_bt.task_planning.language.prompt import fault_message
from bestman_bt.task_planning.language.schema import GoalAnswer, faults_of

Answer = TypeVar("Answer", bound=GoalAnswer)
Checked = TypeVar("Checked")

_LONGEST_ANSWER = 2000
_LOG = logging.getLogger(__name__)


class FaultyAnswerError(Error):
    """An answer is unusable; ``faults``: in words from which the model can correct it."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(map(quoted, faults)))
        self.faults = tuple(quoted(fault) for fault in faults)


def ask_until_valid(
    endpoint: ChatEndpoint,
    request: ChatRequest,
    model: type[Answer],
    check: Callable[[Answer], Checked],
    tries: int,
) -> tuple[Checked, Usage]:
    """Return the first answer that follows ``model``, as converted by ``check``, which raises FaultyAnswerError.

    Raises RefusedError, NoValidAnswerError, and the endpoint's errors.
    """
    used: Usage | None = None
    faults: tuple[str, ...] = ()
    answer = ""
    for number in range(1, tries + 1):
        reply = endpoint.complete(request)
        used = reply.usage if used is None else used + reply.usage
        try:
            checked = check(_parsed(reply, model))
        except FaultyAnswerError as error:
            faults = error.faults
            answer = quoted(_repeated(reply))
            _LOG.warning("answer %d of at most %d was not accepted: %s; it was: %s", number, tries, error, answer)
            request = request.followed_by(Message("assistant", _repeated(reply)), fault_message(faults))
        else:
            _LOG.info("answer %d was accepted: %s in all", number, used)
            return checked, used
    raise NoValidAnswerError(tries, faults, answer)


def _parsed(reply: ChatReply, model: type[Answer]) -> Answer:
    if reply.refusal:
        raise ModelRefusedError(quoted(reply.refusal))
    if not reply.complete:
        raise FaultyAnswerError(["the answer was cut off at the limit of its length; give a shorter one"])
    if reply.tools and not reply.text:
        raise FaultyAnswerError([f"you called {', '.join(reply.tools[:3])}; there are no tools, answer in the message"])
    try:
        answer = model.model_validate_json(_without_fence(reply.text))
    except ValidationError as error:
        raise FaultyAnswerError(faults_of(error)) from None
    if answer.refusal and answer.refusal.strip():
        raise ModelRefusedError(quoted(answer.refusal))
    return answer


def _without_fence(text: str) -> str:
    """Return the inside of the one code fence that models without a JSON mode like to put around their answer."""
    lines = text.strip().splitlines()
    fenced = len(lines) > 2 and lines[0] in ("```", "```json") and lines[-1] == "```"
    return "\n".join(lines[1:-1]) if fenced else text


def _repeated(reply: ChatReply) -> str:
    """Return the model's answer, shortened for repetition."""
    text = reply.text or "(no text)"
    return text if len(text) <= _LONGEST_ANSWER else text[:_LONGEST_ANSWER] + "…"
