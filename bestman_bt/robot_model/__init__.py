"""Robots composed from parts: one URDF with groups, frames, sensors and postures."""
