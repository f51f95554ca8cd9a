"""The nodes of a run: convert, step, publish."""
