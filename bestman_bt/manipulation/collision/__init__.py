"""Collision worlds, built from the world model; they never touch a simulator."""
