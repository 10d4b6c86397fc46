"""Pictures by Blender (Cycles): a job file, rendered by a separate Blender in a separate process."""
