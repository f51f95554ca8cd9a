"""Experiments of the papers, repeated with this project's own code and checked against what is published."""
