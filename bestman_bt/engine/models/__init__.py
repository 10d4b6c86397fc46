"""Nodes and trees that are known from descriptions alone: models in files, packages of trees, placeholders."""
