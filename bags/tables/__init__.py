"""Bags as tables."""
