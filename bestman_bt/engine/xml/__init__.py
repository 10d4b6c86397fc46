"""Tree files: reading XML into elements, and checking them against the registry."""
