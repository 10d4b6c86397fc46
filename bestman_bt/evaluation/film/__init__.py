"""Pictures and films of runs that have ended, by the simulator's fast renderer or by Blender."""
