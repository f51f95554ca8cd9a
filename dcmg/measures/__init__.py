"""Claims about attacks and detectors, measured."""
