"""Generated furniture from options and random draws: shelves, chests, fridges and the like, with doors, drawers and
handles."""
