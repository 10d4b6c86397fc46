"""Task planning: from goals to plans of abilities, and to trees that execute them."""
