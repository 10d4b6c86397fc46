"""Skills of the base: driving, base placement, exploring, localisation."""
