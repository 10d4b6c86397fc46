"""The numbers of streaming set-points."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StreamingParameters:
    """SI units, radians.

    A motion fails as TRACKING when a joint is more than ``tracking_tolerance`` off its set-point for ``tracking_time``,
    and as TIMEOUT when it has not settled (``settle_tolerance``, ``settle_speed``) ``settle_time`` after its last
    set-point. ``stop_time``: a stop brakes within it, if need be harder than the acceleration limits say.

    Set-points never jump: a late one goes on by ``longest_step`` periods at most, so that a slow link slows the motion
    down; one that has slowed it by more than ``slip_limit`` seconds, of which half is forgotten every
    ``slip_half_life``, fails it as TIMEOUT. ``latency``: from a set-point to the reading that shows it.
    """

    tracking_tolerance: float = 0.15
    tracking_time: float = 0.15
    settle_tolerance: float = 0.005
    settle_speed: float = 0.03
    settle_time: float = 2.0
    stop_time: float = 0.3
    moved_by_hand: float = 0.05
    longest_stream_interval: float = 0.1
    longest_step: float = 3.0
    latency: float = 0.1
    slip_limit: float = 0.5
    slip_half_life: float = 1.0
