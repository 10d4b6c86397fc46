"""Scenes from YAML and the worlds that a seed draws from them."""
