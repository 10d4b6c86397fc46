"""The pytest plug-in of this package: ``pytest --pyargs hal.conformance --driver my_package:MyRobot``.

pytest loads it at every start, so it imports nothing and adds no option until that suite is requested. After a run of
the suite's checks, it lists those that did not apply.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

SUITE = "hal.conformance"
NOT_APPLICABLE, MISSING = "does_not_apply", "unsupported"
"""Names of the test properties shown at the end of the report."""


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config, args: list[str]) -> None:
    """Add the suite's options if it is selected, by name or by path."""
    if any(_names_the_suite(argument.partition("::")[0]) for argument in args):
        early_config.pluginmanager.import_plugin(f"{SUITE}.command_line")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the inapplicable checks of the robots under test, and what they declare unsupported."""
    for title, name in (
        ("promises that do not apply", NOT_APPLICABLE),
        ("what the drivers declare missing", MISSING),
    ):
        lines = list(dict.fromkeys(_summary_lines(terminalreporter, name)))
        if lines:
            terminalreporter.section(title)
            for line in lines:
                terminalreporter.line(line)


def _names_the_suite(argument: str) -> bool:
    module = argument == SUITE or argument.startswith(f"{SUITE}.")
    return module or Path(argument).absolute().is_relative_to(Path(__file__).parent / "conformance")


def _summary_lines(terminalreporter: pytest.TerminalReporter, name: str) -> Iterator[str]:
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport) and report.when == "call":
                yield from (str(value) for key, value in report.user_properties if key == name)
