"""What can go wrong between an instruction in words and a checked plan."""

from __future__ import annotations

from collections.abc import Sequence

from bestman_bt.task_planning.symbolic.problem import PlanningError

# Words of a model or a server, fit for a message: one line, printable, no longer than is read.


LONGEST_QUOTE = 300


def quoted(text: str) -> str:
    """Return the text without control characters, such as those that move a terminal's cursor, cut at 300
    characters.
    """
    line = " ".join("".join(character if character.isprintable() else " " for character in text).split())
    return line if len(line) <= LONGEST_QUOTE else line[:LONGEST_QUOTE] + "…"


class LanguageError(PlanningError):
    """No plan came from a language model; the text says why, and never holds the key."""


class EndpointNotSetError(LanguageError):
    """The environment does not say which endpoint to ask, or says it in a way that cannot be used."""


class EndpointUnreachableError(LanguageError):
    """No answer came within the tries and the time allowed."""


class EndpointReplyError(LanguageError):
    """The endpoint refused the question, or its answer breaks the protocol."""


class TranscriptError(LanguageError):
    """A recorded conversation cannot be read, or is not the one that is held now."""


class ModelRefusedError(LanguageError):
    """The model says, in words, that it will not or cannot do what was asked."""


class NoValidAnswerError(LanguageError):
    """Every answer within the allowed tries had faults: ``faults``, those of the last one; ``answer``: its words."""

    def __init__(self, tries: int, faults: Sequence[str], answer: str) -> None:
        self.tries = tries
        self.faults, self.answer = tuple(faults), answer
        counted = f"{tries} tries" if tries > 1 else "one try"
        super().__init__(
            f"no valid answer in {counted}; faults of the last one: {'; '.join(self.faults)}; it was: {answer}"
        )
