"""Hardware abstraction layer: the Robotics API and its implementations."""
