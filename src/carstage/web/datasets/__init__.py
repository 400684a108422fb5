"""Datasets as the page shows them: lists, episodes, frames, labels, exports and validations."""
