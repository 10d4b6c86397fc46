"""Behavior-tree task execution for mobile manipulators."""
