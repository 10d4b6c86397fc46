"""SLAM: simultaneous localisation and mapping."""
