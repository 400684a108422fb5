"""What the simulator offers, as JSON documents for other programs: maps, vehicles, lanes."""
