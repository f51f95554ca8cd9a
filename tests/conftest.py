"""What all tests share: property tests draw the same examples on every machine, however slow, and remember none."""

from __future__ import annotations

from hypothesis import settings
from hypothesis.internal.conjecture import providers

settings.register_profile("everywhere", derandomize=True, deadline=None, database=None)
settings.load_profile("everywhere")
# Hypothesis draws the numbers that it reads in the code of all modules imported so far: a 404 in a web page, or another
# order of the test files, gave the numerical tests other examples.
vars(providers)["is_local_module_file"] = lambda _path: False
