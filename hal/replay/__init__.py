"""Runs recorded at the Robotics API, and played back through it."""
