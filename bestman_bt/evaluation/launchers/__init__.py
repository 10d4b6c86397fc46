"""Launchers that run the episodes of an evaluation: local processes, Ray, Slurm, or a user's own."""
