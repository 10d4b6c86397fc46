"""YAML to checked frozen dataclasses, and where shipped data lies."""

from bestman_bt.configuration.checked import check, override
from bestman_bt.configuration.data import data_names, data_root, find_data
from bestman_bt.configuration.document import Document, dotted, parse_document, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem

__all__ = [
    "ConfigurationError",
    "Document",
    "Problem",
    "check",
    "data_names",
    "data_root",
    "dotted",
    "find_data",
    "override",
    "parse_document",
    "read_document",
]
