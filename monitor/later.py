"""Functions whose modules are imported when they are called: a run asks few of the methods that there are."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["later"]

Given = ParamSpec("Given")
Made = TypeVar("Made")


def later(module: str, name: str) -> Callable[Given, Made]:
    """Return a function that imports `name` of `module` and calls it."""

    def call(*arguments: Given.args, **options: Given.kwargs) -> Made:
        found: Made = getattr(import_module(module), name)(*arguments, **options)
        return found

    return call
