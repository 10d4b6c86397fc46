"""Learning-based manipulation: policies that return action chunks, and their execution."""
