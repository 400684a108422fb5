"""Runs as the page shows them: started, queued, followed, summed up."""
