"""SHA-256 (FIPS 180-4) of several contents side by side, in two ways; see ``digests`` above."""
