"""From plans to behavior trees."""
