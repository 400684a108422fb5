"""Measurements of the framework: capture, conversion, labels, faults, the interface."""
