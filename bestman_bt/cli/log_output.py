"""The log of one package on standard error, while something is done with it."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def shown_log(package: str) -> Iterator[None]:
    """Print what the loggers of ``package`` say from INFO on, and of nobody else."""
    logger = logging.getLogger(package)
    handler = logging.StreamHandler(sys.stderr)
    level, passes = logger.level, logger.propagate
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
        logger.propagate = passes
