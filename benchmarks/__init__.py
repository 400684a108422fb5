"""Measurements of Car-STAGE that are not installed; ``python -m benchmarks --list`` names them."""
