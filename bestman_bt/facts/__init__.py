"""What can be said of the world, a fact in a file: what the robot believes of it, and what is true."""
