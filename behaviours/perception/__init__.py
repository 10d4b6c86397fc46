"""Perception skills: detection, scanning, searching, tidying, and updates of the belief."""
