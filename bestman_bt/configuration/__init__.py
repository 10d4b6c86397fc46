"""YAML to checked frozen dataclasses, and where shipped data lies.

What reads YAML is imported when it is used: who only looks for a file need not load the machinery of the checks.
"""
