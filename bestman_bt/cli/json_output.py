"""With ``--json``, standard output holds exactly one document; prints of libraries and plug-ins go elsewhere."""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any


@contextmanager
def json_output(wanted: bool) -> Iterator[Callable[[dict[str, Any]], None]]:
    """Yield a function that receives the document. If ``wanted``, the document is printed at the end, and other output
    goes to standard error.

    The redirection includes C libraries: it replaces the file descriptor.
    """
    documents: list[dict[str, Any]] = []
    if not wanted:
        yield documents.append
        return
    try:
        with redirect_stdout(sys.stderr), _descriptor_to_standard_error():
            yield documents.append
    finally:  # also where the verb ends with an exit code
        for document in documents:
            print(json.dumps(document, allow_nan=False), flush=True)


@contextmanager
def _descriptor_to_standard_error() -> Iterator[None]:
    c_library = ctypes.CDLL(None)
    c_library.fflush(None)
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        c_library.fflush(None)
        os.dup2(kept, 1)
        os.close(kept)
