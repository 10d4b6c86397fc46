"""Segmentation of views into support surfaces and the things on them."""
