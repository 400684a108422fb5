"""Files that several processes use: whole or not there, and held by one process at a time."""
