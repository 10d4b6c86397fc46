"""Errors between an instruction as text and a checked plan."""

from __future__ import annotations

from collections.abc import Sequence

from bestman_bt.task_planning.symbolic.problem import PlanningError

LONGEST_QUOTE = 300


def quoted(text: str) -> str:
    """Return the text without control characters, such as cursor movements, shortened to 300 characters."""
    line = " ".join("".join(character if character.isprintable() else " " for character in text).split())
    return line if len(line) <= LONGEST_QUOTE else line[:LONGEST_QUOTE] + "…"


class LanguageError(PlanningError):
    """A language model returned no valid plan; the message gives the reason and never contains the key."""


class EndpointNotSetError(LanguageError):
    """The environment does not specify a valid endpoint."""


class EndpointUnreachableError(LanguageError):
    """No answer within the number of attempts and the time limit."""


class EndpointReplyError(LanguageError):
    """The endpoint refused the question, or its answer violates the protocol."""


class TranscriptError(LanguageError):
    """A recorded conversation cannot be read, or differs from the current one."""


class ModelRefusedError(LanguageError):
    """The model refused the instruction."""


class NoValidAnswerError(LanguageError):
    """Every answer had faults; ``faults``: those of the last one; ``answer``: its text."""

    def __init__(self, tries: int, faults: Sequence[str], answer: str) -> None:
        self.tries = tries
        self.faults, self.answer = tuple(faults), answer
        counted = f"{tries} tries" if tries > 1 else "one try"
        super().__init__(
            f"no valid answer in {counted}; faults of the last one: {'; '.join(self.faults)}; it was: {answer}"
        )
