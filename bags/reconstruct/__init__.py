"""Inputs and attacks reconstructed from what was received."""
