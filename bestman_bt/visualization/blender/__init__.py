"""Pictures by Blender (Cycles): a job is written down, and a Blender of its own, in a process of its own, paints it."""
