"""Segmentation of views into support surfaces and the objects on them."""
