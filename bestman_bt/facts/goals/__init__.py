"""Kinds of task goals, one file each: checks, entries, judgement."""
