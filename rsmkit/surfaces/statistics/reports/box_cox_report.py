"""Statistics of a surface of the transformed response, from those of the surface inside it."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsmkit.surfaces.models.box_cox import BoxCoxSurface
from rsmkit.surfaces.reading import numbers

__all__ = ["box_cox_report", "box_cox_summary"]


def box_cox_report(surface: BoxCoxSurface, inner: dict[str, Any]) -> dict[str, Any]:
    """Report of the inner surface; leave-one-out figures are in the response's own units."""
    total = float(((surface.y - surface.y.mean()) ** 2).sum())
    kept = ("press_weighted", "r2_predicted_weighted")  # the power kept, and of the transformed response
    return {
        **{key: value for key, value in inner.items() if key not in kept},
        "model": surface.form,
        "power": surface.power,
        "power_std_error": surface.power_error,
        "predictions": {
            "median": numbers(surface.predict(surface.inner.data.points)),
            "mean": numbers(surface.mean(surface.inner.data.points)),
        },
        "sigma_units": f"transformed {surface.response}",
        "press": surface.nested_press,
        "rmse_loo": float(np.sqrt(surface.nested_press / len(surface.y))),
        "r2_predicted": 1.0 - surface.nested_press / total if total > 0 else None,
        "note": f"statistics are those of the response transformed with Box-Cox power {surface.power:.4g}; "
        "predictions are medians, their intervals allow for the power",
    }


def box_cox_summary(surface: BoxCoxSurface, inner: str) -> str:
    """Summary of the inner surface, below the power."""
    error = f"standard error {surface.power_error:.2g}"
    return f"Box-Cox power {surface.power:.4g} of the response ({error}); predictions are medians\n{inner}"
