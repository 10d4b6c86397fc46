"""What a robot's YAML may say about a UR controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from bestman_bt.configuration.quantity import Frequency, Lengths3, Mass, PositiveTime

Rate = Annotated[Frequency, Field(le=500.0)]
Gain = Annotated[float, Field(ge=100.0, le=2000.0)]
Lookahead = Annotated[PositiveTime, Field(ge=0.03, le=0.2)]


@dataclass(frozen=True)
class UROptions:
    """Options of ``driver: ur``.

    ``rate``: hertz of the set-points and readings; 500 for e-series, 125 for CB3. ``servo_lookahead`` (seconds) and
    ``servo_gain``: of the controller's ``servoj``: how far it smooths set-points, and how hard it follows them.
    ``payload``, ``payload_center``: kg and metres in the flange, of what the arm carries always; the controller's own
    if nothing is said. ``controller_watchdog``: seconds without a sign of life of ours after which the controller ends
    its program. ``longest_delay``: seconds that readings may come late for a while. ``connect_timeout``: seconds.
    """

    rate: Rate = 500.0
    servo_lookahead: Lookahead = 0.03
    servo_gain: Gain = 400.0
    payload: Mass | None = None
    payload_center: Lengths3 = (0.0, 0.0, 0.0)
    controller_watchdog: PositiveTime = 0.25
    longest_delay: PositiveTime = 0.1
    connect_timeout: PositiveTime = 2.0
