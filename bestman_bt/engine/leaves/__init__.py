"""Leaves: the base classes that skills derive from, and the built-in actions and conditions."""
