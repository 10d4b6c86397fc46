"""Leaves and decorators of Nav2 by its names and ports, on this library's controllers and algorithms."""
