"""Tasks, success predicates, the honesty audit, batch runs."""
