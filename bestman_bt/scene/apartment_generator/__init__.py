"""Generator of apartments: rooms, walls with doorways, and furniture that leaves all rooms accessible."""
