"""Handles of doors and drawers."""
