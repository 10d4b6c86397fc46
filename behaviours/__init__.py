"""Skill leaves of bestman-bt."""
