"""Runs: recorded offline, replayed, played back, read."""
