"""Arm control."""
