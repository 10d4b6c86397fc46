"""Recording of runs at the Robotics API, and their replay."""
