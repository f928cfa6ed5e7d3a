"""Statistics of a Gaussian process as JSON values and as text."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.language.space import Floats
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface

__all__ = ["process_diagnostics", "process_report", "process_summary"]


def process_report(surface: GaussianProcessSurface) -> dict[str, Any]:
    """Statistics as JSON values."""
    y = surface.data.y
    total = float(((y - float(y.mean())) ** 2).sum())
    return {
        "response": surface.response,
        "model": surface.form,
        "kernel": surface.kernel,
        "runs": len(y),
        "duplicates_left_out": surface.data.duplicates,
        "correlation_lengths": dict(zip(surface.column_names, surface.lengths.tolist(), strict=True)),
        "process_sd": surface.process_sd,
        "nugget": surface.nugget,
        "log_likelihood": surface.log_likelihood,
        "press": surface.press,
        "rmse_loo": float(np.sqrt(surface.press / len(y))),
        "r2_predicted": 1.0 - surface.press / total if total > 0 else None,
        "interval_widening": surface.calibration,
    }


def process_summary(surface: GaussianProcessSurface, report: dict[str, Any]) -> str:
    """The report as text."""
    lengths = ", ".join(f"{name} {value:.3g}" for name, value in report["correlation_lengths"].items())
    return (
        f"{surface.response}: Gaussian process ({surface.kernel}), {len(surface.data)} runs\n\n"
        f"Correlation lengths (the runs span 2): {lengths}\n"
        f"Process standard deviation {report['process_sd']:.5g}, nugget {surface.nugget:.3g}\n"
        f"Leave-one-out error {report['rmse_loo']:.5g}, predicted R2 {report['r2_predicted']:.5g}; "
        f"intervals widened by {surface.calibration:.3g}"
    )


def process_diagnostics(surface: GaussianProcessSurface) -> dict[str, Floats]:
    """Observed and predicted values of the runs, each predicted from the others, and these errors scaled."""
    observed, residual = surface.data.y, surface.loo_residuals
    studentised = residual / (residual.std() or 1.0)
    return {"observed": observed, "fitted": observed - residual, "studentised": studentised}
