"""Symbolic planning: facts, problems, and a planner for them."""
