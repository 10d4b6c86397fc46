"""Rerun recordings of runs; rerun itself is imported when a recording is opened."""
