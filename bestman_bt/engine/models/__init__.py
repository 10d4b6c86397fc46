"""Nodes and trees known only from descriptions: models in files, packages of trees, placeholders."""
