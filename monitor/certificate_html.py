"""A certificate in a notebook: its page as a table, beside the poles and what the residual makes of a bias."""

from __future__ import annotations

import io
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from monitor.wording import describe

if TYPE_CHECKING:
    from monitor.certificate import Certificate

__all__ = ["as_html"]


def as_html(title: str, certificate: Certificate) -> str:
    """The page of a certificate.

    Args:
        title: what stands above it.
        certificate: of any design, refused ones included.
    """
    rows = "".join(f"<tr><td style='text-align: left'>{escape(line)}</td></tr>" for line in describe(certificate)[1:])
    colour = "#00654c" if certificate.accepted else "#b04600"
    head = f"<b>{escape(title)}</b>: <span style='color: {colour}'>{escape(certificate.verdict)}</span>"
    return f"<div>{head}<table>{rows}</table>{_picture(certificate)}</div>"


def _picture(certificate: Certificate) -> str:
    """Poles in the unit circle, and the residual's gain by component, as SVG."""
    dynamics, residual = certificate.dynamics, certificate.residual
    if dynamics is None or residual is None:
        return ""
    from matplotlib.figure import Figure  # noqa: PLC0415 (only a notebook draws)

    figure = Figure(figsize=(8.0, 2.8), layout="constrained")
    poles, gains = figure.subplots(1, 2)
    around = np.linspace(0.0, 2.0 * np.pi, 200)
    poles.plot(np.cos(around), np.sin(around), color="0.7")
    poles.plot(*np.reshape(dynamics.eigenvalues, (-1, 2)).T, "x")
    poles.set(aspect="equal", title="poles of the error", xlabel="real part", ylabel="imaginary part")
    outputs = np.arange(1, residual.peak_gain.shape[1] + 1)
    gains.bar(outputs - 0.2, np.abs(residual.peak_gain).max(axis=0), width=0.4, label="at its peak")
    gains.bar(outputs + 0.2, np.abs(residual.dc_gain).max(axis=0), width=0.4, label="steady")
    gains.set(title="largest residual of a unit bias", xlabel="attacked output", xticks=outputs)
    figure.legend(loc="outside right upper")
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg")
    return drawn.getvalue()[drawn.getvalue().index("<svg") :]
