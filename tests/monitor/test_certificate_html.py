"""Designs in an interpreter and in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import dcmg
from monitor.observers import KINDS
from monitor.wording import describe

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _states(samples: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(1)
    A = np.array([[0.8, 0.2, 0.0], [-0.1, 0.9, 0.1], [0.0, 0.1, 0.7]])
    x, d = np.zeros((samples, 3)), rng.uniform(-1.0, 1.0, samples)
    for t in range(samples - 1):
        x[t + 1] = A @ x[t] + [d[t], 0.0, 0.0]
    return x, d


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_design_shows_its_certificate(kind: str) -> None:
    """Verdict and every line of the page as text, the same in a notebook with a picture of poles and gains."""
    x, d = _states(300)
    design = dcmg.design(y=x, d=d, kind=kind, sampling_period_sec=0.01)
    assert design.accepted, design.verdict
    first, *lines = repr(design).splitlines()
    assert first == f"<{kind} design: {design.verdict}>"
    assert lines == [f"  {line}" for line in describe(design.certificate)[1:]] != []
    page = design._repr_html_()
    assert design.verdict.replace("<", "&lt;") in page
    assert page.count("<tr>") == len(lines)
    assert ("<svg" in page) == (design.certificate.dynamics is not None and design.certificate.residual is not None)
    assert repr(design.certificate) == f"<{kind} certificate: {design.verdict}>"


def test_a_refusal_shows_why() -> None:
    """In the colour of a refusal, without a picture; names are no markup."""
    design = dcmg.design(y=np.random.default_rng(2).normal(size=(30, 3)), sampling_period_sec=0.01)
    assert not design.accepted
    assert "<svg" not in design._repr_html_()
    assert design.verdict in repr(design)
