"""A simulated robot over any physics engine: channels, sensors, and who watches that a run is honest."""
