"""What a history showed, as every design's certificate says it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.certificate import DataReport

if TYPE_CHECKING:
    from monitor.history import DataMatrices, History
    from monitor.output_map import OutputMap
    from monitor.rank import RankDecision


def report_data(
    history: History, data: DataMatrices, decision: RankDecision, output: OutputMap | None = None
) -> DataReport:
    """Put dimensions, rank decision and singular values into the report."""
    n, m, m_d = history.states, history.inputs, decision.unknown_inputs
    regressors = np.vstack([data.U_p, data.Y_p, data.X_p, data.U_f, data.Y_f])
    return DataReport(
        states=n,
        known_inputs=m,
        outputs=history.outputs,
        experiments=data.experiments,
        columns=data.columns,
        dropped=data.dropped,
        sampling_period_sec=history.sampling_period_sec,
        unknown_inputs=m_d,
        rank=None if m_d is None else 2 * m + n + m_d,
        rank_basis=decision.basis.value,
        rank_confidence=decision.confidence,
        rank_reason="; ".join([decision.reason, *([] if output is None else output.words())]),
        exciting=m_d is not None,
        excitation=decision.excitation,
        innovation_values=decision.innovation_values,
        singular_values=np.asarray(np.linalg.svd(regressors, compute_uv=False), dtype=np.float64),
    )
