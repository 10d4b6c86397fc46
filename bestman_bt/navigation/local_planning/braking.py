"""How fast one may go towards something: so that there is always room to stop before it."""

from __future__ import annotations

import math

from bestman_bt.messages import Twist2D


def braking_time(twist: Twist2D, acceleration: float, angular_acceleration: float) -> float:
    """Seconds from ``twist`` to rest at a constant deceleration, m/s² and rad/s²."""
    return max(math.hypot(twist.vx, twist.vy) / acceleration, abs(twist.wz) / angular_acceleration)


def safe_share(time_to_contact: float, reaction: float, braking: float) -> float:
    """The largest share, 0 to 1, of a velocity at which the base stops before it touches anything.

    ``time_to_contact``: seconds at the whole velocity (infinite: nothing is in the way). ``reaction``: seconds before
    the brakes act, ``braking``: seconds they need at the whole velocity. At a share s the base still moves on for
    ``s reaction + s² braking / 2`` seconds' worth of the whole velocity, which must not exceed ``time_to_contact``.
    """
    if time_to_contact >= reaction + braking / 2.0:
        return 1.0
    if time_to_contact <= 0.0:
        return 0.0
    if braking < 1e-6:
        return time_to_contact / reaction
    return (math.sqrt(reaction**2 + 2.0 * braking * time_to_contact) - reaction) / braking
