"""File logs and statistics of a tree's state changes. Each attaches itself to a tree and costs nothing once closed."""
