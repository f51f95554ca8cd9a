"""How the inputs of the offline experiment move: drawn anew every sample, binary, or sums of tones (T, remark 8)."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from dgu_sim.linear import FloatArray
from dgu_sim.model import Frozen

__all__ = ["Excitation", "MultisineExcitation", "PrbsExcitation", "UniformExcitation"]

_DIGITS = 12  # the last bits of a cosine differ between processors
_REGISTER = 9  # 511 samples: no two signals of a grid share a stretch of it unless the record is longer


class UniformExcitation(Frozen):
    """Independent draws, U(-1, 1) in every sample."""

    kind: Literal["uniform"] = Field(default="uniform", description="`uniform`")

    def signals(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return signals within [-1, 1], shape (count, samples)."""
        return generator.uniform(-1.0, 1.0, (count, samples))

    def rows(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return the same with time first, shape (samples, count), drawn in that order."""
        return generator.uniform(-1.0, 1.0, (samples, count))


class PrbsExcitation(Frozen):
    """Pseudo-random binary signals: stretches of one maximum-length sequence, far apart, each from a random place on.

    Persistently exciting of any order up to a third of the record: -1 and 1 are as far from the operating point as the
    spreads allow, so noise matters least.
    """

    kind: Literal["prbs"] = Field(description="`prbs`")
    hold_samples: Annotated[int, Field(ge=1)] = Field(
        default=1, description="A signal may change every so many samples."
    )

    def signals(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return signals of -1 and 1, shape (count, samples)."""
        from scipy.signal import max_len_seq  # noqa: PLC0415 (half a second, for this excitation alone)

        switches = -(-samples // self.hold_samples)
        register = max(_REGISTER, int(count * (switches + 1)).bit_length())
        start = int(generator.integers(1, 2**register))
        state = np.array([start >> bit & 1 for bit in range(register)], dtype=np.int8)
        sequence, _ = max_len_seq(register, state=state)
        apart = len(sequence) // count
        stretches = np.stack([np.roll(sequence, -number * apart)[:switches] for number in range(count)])
        held = np.repeat(2.0 * stretches - 1.0, self.hold_samples, axis=1)[:, :samples]
        return np.asarray(held, dtype=np.float64)

    def rows(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return the same with time first, shape (samples, count)."""
        return self.signals(generator, count, samples).T


class MultisineExcitation(Frozen):
    """Sums of tones with random phases, each signal scaled to a largest value of 1.

    u(t) = sum_k cos(2 pi k t / T + phi_k), k over `tones` harmonics of the record's length T, spread evenly up to half
    the sampling rate. One signal is persistently exciting of order 2 tones; all harmonics below that rate unless given.
    """

    kind: Literal["multisine"] = Field(description="`multisine`")
    tones: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="Tones of each signal; none: all that fit, half the samples."
    )

    def signals(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return signals within [-1, 1], shape (count, samples)."""
        most = max((samples - 1) // 2, 1)
        wanted = most if self.tones is None else min(self.tones, most)
        harmonics = np.unique(np.linspace(1, most, wanted).round())
        phases = generator.uniform(0.0, 2.0 * np.pi, (count, len(harmonics), 1))
        angles = 2.0 * np.pi * harmonics[:, None] * np.arange(samples) / samples + phases
        summed = np.cos(angles).sum(axis=1)
        return np.asarray(np.round(summed / np.abs(summed).max(axis=1, keepdims=True), _DIGITS), dtype=np.float64)

    def rows(self, generator: np.random.Generator, count: int, samples: int) -> FloatArray:
        """Return the same with time first, shape (samples, count)."""
        return self.signals(generator, count, samples).T


Excitation = Annotated[UniformExcitation | PrbsExcitation | MultisineExcitation, Field(discriminator="kind")]
