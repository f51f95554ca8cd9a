"""Figures of a run for papers: vector graphics in the width of a journal's column."""
