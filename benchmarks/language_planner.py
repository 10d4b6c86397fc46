"""What the language planner makes of a server that misbehaves: questions until a right plan, or how it ends.

Also its own time. No model is asked: what a model would answer, and how often rightly, is not measured here.

Example: python -m benchmarks.language_planner
"""

from __future__ import annotations

import logging
import time
from statistics import median

from bestman_bt.task_planning.language.errors import LanguageError
from tests.task_planning.language.kitchen_problem import RIGHT, kitchen
from tests.task_planning.language.misbehaving_server import says, serving
from tests.task_planning.language.test_misbehaviour import ANSWERS, SERVERS, planner

TIMES = 20


def main() -> None:
    """Print a row for each way of misbehaving, and the time of a right answer."""
    logging.disable(logging.CRITICAL)
    print("| the server | questions until right | posts until right | if it never mends |")
    print("| --- | --- | --- | --- |")
    for way, (behaviour, _) in (ANSWERS | SERVERS).items():
        timeout = 1.0 if way == "timeout" else 10.0
        with serving(behaviour, says(RIGHT)) as server:
            questions = planner(server, timeout=timeout).propose(kitchen()).usage.questions
            posts = len(server.questions)
        with serving(behaviour) as server:
            try:
                planner(server, timeout=timeout).propose(kitchen())
                ending = "a plan"
            except LanguageError as error:
                ending = type(error).__name__
        print(f"| {way} | {questions} | {posts} | {ending} |")
    seconds = []
    for _ in range(TIMES):
        with serving(says(RIGHT)) as server:
            started = time.perf_counter()
            proposal = planner(server).propose(kitchen())
            seconds.append(time.perf_counter() - started - proposal.usage.seconds)
    print(f"\nown time for a plan that is right at once, without the server: {1e3 * median(seconds):.1f} ms (median)")


if __name__ == "__main__":
    main()
