"""YAML to checked frozen dataclasses, and the location of shipped data.

Modules that read YAML are imported on use: finding a file does not load the checks.
"""
