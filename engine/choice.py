"""Which kernels run: those of the widest instruction set of the processor, unless the environment names others."""

import os

from engine.kernels import instruction_sets

__all__ = ["NUMPY", "VARIABLE", "EngineError", "available", "chosen", "described"]

NUMPY = "numpy"
"""The engine without kernels: the same numbers, bit for bit, in many times the time."""

VARIABLE = "DCMG_ENGINE"
"""Environment variable that names the engine to use."""


class EngineError(Exception):
    """The environment asks for an engine that is not there. The message is one line."""


def available() -> tuple[str, ...]:
    """Engines that run on this processor, fastest first."""
    return (*instruction_sets(), NUMPY)


def chosen() -> str:
    """Return the engine that runs: avx512, avx2, sse2 (baseline on other processors), or numpy.

    Raises:
        EngineError: The environment names one that is not there.
    """
    engines = available()
    wanted = os.environ.get(VARIABLE, "") or engines[0]
    if wanted not in engines:
        raise EngineError(f"{VARIABLE} = {wanted!r}: expected an engine that runs here: {', '.join(engines)}")
    return wanted


def described() -> str:
    """Return what runs, in words: for `dcmg --version` and the bag."""
    engine = chosen()
    return "numpy, no kernels" if engine == NUMPY else f"{engine} kernels"
