"""What all tests share: property tests draw the same examples on every machine, however slow, and remember none."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("everywhere", derandomize=True, deadline=None, database=None)
settings.load_profile("everywhere")
