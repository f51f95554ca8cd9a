"""The compiled functions, all of them or none."""

from typing import TYPE_CHECKING

try:
    from engine._native import advance, draw, instruction_sets, watch
except ImportError:  # no compiler when this was installed, or kernels of another version: `make install`
    if not TYPE_CHECKING:
        advance = draw = watch = None  # nobody calls them where no instruction set is named

        def instruction_sets() -> list[str]:
            """Return no name."""
            return []


__all__ = ["advance", "draw", "instruction_sets", "watch"]
