"""Task planning: goals in, plans of abilities out, trees that carry them out."""
