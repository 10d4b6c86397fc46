"""Questions and answers as lines of JSON over a Unix socket that only its owner may open."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hal.api import RobotError

Answer = Callable[[dict[str, Any]], Mapping[str, Any]]


class JsonLineServer:
    """Answers each line by ``answer(question)``; what it raises becomes ``{"error": …}``."""

    def __init__(self, path: Path, answer: Answer) -> None:
        self._path, self._answer = path, answer
        self._socket = socket.socket(socket.AF_UNIX)
        mask = os.umask(0o177)
        try:
            self._socket.bind(str(path))
        finally:
            os.umask(mask)
        self._socket.listen(4)

    def start(self) -> None:
        """Accept clients."""
        threading.Thread(target=self._accept, name=self._path.name, daemon=True).start()

    def close(self) -> None:
        """Close the socket and remove it."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._attend, args=(client,), name=self._path.name, daemon=True).start()

    def _attend(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError), client.makefile("rwb") as stream:
            for line in stream:
                try:
                    answer = dict(self._answer(json.loads(line)))
                except (LookupError, ValueError, TypeError, RobotError, TimeoutError) as error:
                    answer = {"error": str(error)}
                stream.write(json.dumps(answer).encode() + b"\n")
                stream.flush()


def ask(path: Path, question: Mapping[str, Any], timeout: float = 10.0) -> dict[str, Any]:
    """One question and its answer; LookupError with the answer's own words where it is an error."""
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(timeout)
        client.connect(str(path))
        with client.makefile("rwb") as stream:
            stream.write(json.dumps(dict(question)).encode() + b"\n")
            stream.flush()
            answer: dict[str, Any] = json.loads(stream.readline())
    if "error" in answer:
        raise LookupError(answer["error"])
    return answer
