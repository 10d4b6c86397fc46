"""Groot2's live protocol over a running tree; needs the extra ``groot2``."""
