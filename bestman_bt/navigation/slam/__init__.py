"""SLAM: maps made on the way."""
