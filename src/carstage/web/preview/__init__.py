"""Pictures of what is being recorded, and through a sensor that is still being placed."""
