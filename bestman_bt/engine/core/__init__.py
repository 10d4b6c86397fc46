"""What nodes and trees are made of: status, ports, the node, the tree, and the rules around a tick."""
