"""The core of nodes and trees: status, ports, the node, the tree, and the rules around a tick."""
