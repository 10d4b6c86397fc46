"""Whichever process of a hardware run is killed or stopped while the arm moves: the arm rests until it is commanded."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from benchmarks.kill_matrix import PROCESSES, REST_LIMIT, ROBOTS, SIGNALS, trials
from hal.twins.process import TwinProcess
from tests.hal.twinned import SLACK, twin_settings

pytestmark = [pytest.mark.real_time, pytest.mark.slow]

SDKS = {"xarm": "xarm", "ur": "rtde_control"}


BESIDE_OTHERS = ("xarm",)
"""Those whose processes are few enough to be tested beside other tests."""
PARAMETERS = [pytest.param(name, marks=() if name in BESIDE_OTHERS else pytest.mark.alone) for name in ROBOTS]


@pytest.fixture(scope="module", params=PARAMETERS)
def vendor(request: pytest.FixtureRequest) -> str:
    # `make test` installs them; another installation may be without the vendors' SDKs.
    pytest.importorskip(SDKS[request.param], reason=f"the extra {request.param} is not installed")
    return str(request.param)


@pytest.fixture(scope="module")
def twin(vendor: str) -> Iterator[TwinProcess]:
    with TwinProcess(ROBOTS[vendor], "pick_place_table", seed=1) as running:
        yield running


def test_a_process_that_is_killed_or_stopped_leaves_the_arm_at_rest_until_it_is_commanded_again(
    vendor: str, twin: TwinProcess
) -> None:
    cases = [(process, kind) for process in PROCESSES[vendor] for kind in SIGNALS]
    done = trials(twin, ROBOTS[vendor], cases, 7, twin_settings(twin))
    assert len(done) == len(cases)
    for process, kind, result in done:
        assert result.rest < REST_LIMIT + SLACK, (process, kind, result)
        assert not result.moved_later, (process, kind, result)
        assert result.again is not None, (process, kind, result)
