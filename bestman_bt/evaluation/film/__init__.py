"""Pictures and films of runs that have ended, by the simulator's fast renderer or by Blender."""

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError, read_filmed_run

__all__ = ["FilmError", "FilmedRun", "read_filmed_run"]
