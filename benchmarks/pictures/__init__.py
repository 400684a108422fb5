"""The documentation's pictures, drawn from fixed seeds: ``python -m benchmarks pictures``."""
