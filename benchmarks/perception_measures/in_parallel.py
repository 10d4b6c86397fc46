"""The same function for many seeds, in one process or several; the results do not depend on how many."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

Result = TypeVar("Result")


def in_parallel(call: Callable[[int], Result], seeds: Sequence[int], jobs: int, title: str) -> list[Result]:
    """``call`` of each seed, in their order; progress goes to standard error where that is a terminal."""
    columns = TextColumn(title), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task(title, total=len(seeds))
        results: list[Result] = []
        if jobs == 1:
            for seed in seeds:
                results.append(call(seed))
                progress.advance(task)
            return results
        with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
            for result in pool.map(call, seeds):
                results.append(result)
                progress.advance(task)
    return results
