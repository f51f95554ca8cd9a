"""A page in a process of its own, as a person starts it."""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def serving_page(*words: str) -> Iterator[str]:
    """Run `dcmg page WORDS`; the address is what it says first."""
    command = [sys.executable, "-m", "dcmg", "page", *words, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
