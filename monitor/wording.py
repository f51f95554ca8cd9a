"""A certificate in plain words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.certificate import Certificate, DataReport, DynamicsReport, Guarantee, ResidualReport
    from monitor.proof import Proof


def accepted(data: DataReport, dynamics: DynamicsReport, residual: ResidualReport, proof: Proof) -> str:
    """Verdict on an accepted design, one line."""
    speed = f"errors shrink to 1 % in {dynamics.convergence_steps} steps (radius {dynamics.spectral_radius:.3g})"
    if residual.blind:
        return f"accepted for its estimate only, BLIND to every falsification; {speed}; {proof.words()}"
    inputs = f"{data.unknown_inputs} unknown inputs ({data.rank_basis})"
    return f"accepted: {inputs}; {speed}; {sees(residual)}; {proof.words()}"


def sees(residual: ResidualReport) -> str:
    """What a residual shows of constant biases, a few words."""
    if residual.blind:
        return "BLIND to every falsification: for its estimate only"
    hidden = residual.invisible_bias.shape[1]
    if not hidden:
        return "every constant bias leaves a residual"
    leaves = "leaves" if hidden == 1 else "leave"
    return f"{hidden} of {len(residual.threshold)} directions of constant bias {leaves} no steady residual"


def blind_reason(data: DataReport | None) -> str:
    """Why the residual shows nothing."""
    if data is not None and data.unknown_inputs is not None and data.unknown_inputs >= data.outputs:
        return (
            f"blind: {data.unknown_inputs} unknown inputs explain every change of {data.outputs} outputs, "
            "the residual is always zero"
        )
    return "blind: the residual stays zero under every falsification; choose another strategy"


def describe(certificate: Certificate) -> list[str]:
    """The certificate as lines of text for a terminal, verdict first."""
    lines = [f"{certificate.kind}: {certificate.verdict}"]
    if certificate.data is not None:
        lines += _data_lines(certificate.data)
    if certificate.dynamics is not None:
        lines += _dynamics_lines(certificate.dynamics)
    if certificate.proof is not None:
        lines += certificate.proof.lines()
    if certificate.lag:
        lines.append(f"lag: at step k the estimate is of step k - {certificate.lag}")
    if certificate.guarantee is not None:
        lines += _guarantee_lines(certificate.guarantee)
    if certificate.residual is not None:
        lines += _residual_lines(certificate.residual)
    if certificate.method is not None:
        lines += certificate.method.lines()
    return lines


def _data_lines(data: DataReport) -> list[str]:
    size = f"{data.states} states, {data.known_inputs} known inputs, {data.outputs} outputs, "
    size += f"T_s {data.sampling_period_sec:g} s"
    gaps = f", {data.dropped} more dropped for gaps" if data.dropped else ""
    rank = "undecided" if data.rank is None else str(data.rank)
    verdict = "exciting" if data.exciting else "not shown to be exciting"
    return [
        f"data: {size}; {data.columns} columns of {data.experiments} experiments{gaps}",
        f"rank: {rank} ({data.rank_reason}; confidence {data.rank_confidence:.2f}); {verdict}",
        f"singular values: innovations {_numbers(data.innovation_values)}; regressors {_numbers(data.singular_values)}",
    ]


def _dynamics_lines(dynamics: DynamicsReport) -> list[str]:
    eigenvalues = ", ".join(_complex(real, imaginary) for real, imaginary in dynamics.eigenvalues)
    settles = "never" if dynamics.convergence_sec is None else f"after {dynamics.convergence_sec:.3g} s"
    misfit = f"kernel residual {dynamics.kernel_residual:.2g}"
    return [
        f"observer: order {dynamics.order}, strategy {dynamics.strategy}, {misfit}",
        f"error: eigenvalues {eigenvalues or 'none'}; radius {dynamics.spectral_radius:.4g}; gone (1 %) {settles}",
    ]


def _guarantee_lines(guarantee: Guarantee) -> list[str]:
    ranks = f"rank Gamma grows by {guarantee.gained_rank}, exact decoupling needs {guarantee.needed_rank}"
    if guarantee.exact:
        return [f"guarantee: unknown inputs of any size are cancelled exactly ({ranks})"]
    lmi = f"gamma {guarantee.gamma:.3g} and bound {guarantee.bound:.3g} by the LMI"
    error = f"|H e| <= {min(guarantee.bound, guarantee.response_bound):.3g}, {guarantee.reached:.3g} is reached"
    lines = [
        f"guarantee: not exact ({ranks}); |w| = 1 is {guarantee.unit}",
        f"guaranteed for |w| <= 1: {error} ({lmi}); input error <= {guarantee.input_bound:.3g}",
    ]
    if guarantee.residual_bound is not None and guarantee.certain_bias is not None:
        moved, certain = _numbers(guarantee.residual_bound), _numbers(guarantee.certain_bias)
        lines.append(
            f"such inputs alone move the residual up to {moved}; a bias is seen through them from {certain} on"
        )
    return lines


def _residual_lines(residual: ResidualReport) -> list[str]:
    if residual.blind:
        return ["residual: BLIND, it stays zero whatever is falsified"]
    free = f"{residual.stealthy_inputs} dimensions per step stay free to an attacker"
    hidden = [f"({_numbers(column)})" for column in residual.invisible_bias.T]
    once, lasting = _numbers(residual.smallest_bias), _numbers(residual.smallest_steady_bias)
    return [
        f"residual: rank {residual.residual_rank}, {free}",
        f"constant biases without steady residual: spanned by {', '.join(hidden) or 'none'}",
        f"smallest bias seen at thresholds {_numbers(residual.threshold)}: {once}; for good: {lasting}",
        f"noise: residual standard deviations under unit noise {_numbers(np.sqrt(np.diag(residual.noise_gain)))}",
    ]


def _complex(real: float, imaginary: float) -> str:
    return f"{real:.4g}{imaginary:+.4g}i" if imaginary else f"{real:.4g}"


def _numbers(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
