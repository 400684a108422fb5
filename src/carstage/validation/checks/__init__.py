"""The checks of ``carstage validate``: each recomputes one thing from the files alone."""
