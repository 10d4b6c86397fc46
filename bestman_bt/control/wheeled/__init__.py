"""Control of wheeled bases."""
