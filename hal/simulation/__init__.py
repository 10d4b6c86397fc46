"""A simulated robot over any physics engine: channels, sensors, and the audit of a run."""
