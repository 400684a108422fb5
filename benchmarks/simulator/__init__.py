"""Measurements and checks of the embedded simulator by the real client."""
