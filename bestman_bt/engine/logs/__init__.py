"""File logs and statistics of a tree's state changes. Each attaches itself to a tree and has no cost once closed."""
