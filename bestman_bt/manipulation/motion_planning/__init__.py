"""Motion planning for arms."""
