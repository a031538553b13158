"""What a run achieved as JSON: the schema of ``summary.json`` and of the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # `arm3dof doctor --json` must work where Pinocchio does not
    from arm3dof.runtime.metrics import Metrics
    from arm3dof.vision.locate import View

_FIGURES = (
    "settling_time_s",
    "final_error_deg",
    "peak_torque_nm",
    "torque_limit_nm",
    "torque_violations",
    "energy_j",
    "step_time_us",
    "status_counts",
)


def run_report(metrics: Metrics | None, files: Iterable[Path] = ()) -> dict[str, object]:
    """Return a run's figures of merit with the unit in every name.

    Args:
        metrics: the figures; ``None`` when there was no run, and every figure is ``None``.
        files: what was written.
    """
    figures: dict[str, object] = dict.fromkeys(_FIGURES)
    if metrics is not None:
        figures |= {
            "settling_time_s": metrics.settling_time,
            "final_error_deg": math.degrees(metrics.final_error),
            "peak_torque_nm": metrics.peak_torque,
            "torque_limit_nm": metrics.torque_limit,
            "torque_violations": metrics.torque_violations,
            "energy_j": metrics.energy,
            "step_time_us": {
                "p50": metrics.step_time_p50 * 1e6,
                "p99": metrics.step_time_p99 * 1e6,
                "max": metrics.step_time_max * 1e6,
            },
            "status_counts": metrics.status_counts,
        }
    settled = metrics is not None and metrics.settled
    return {"settled": settled, **figures, "files": [str(file) for file in files]}


def view_report(view: View, limit_m: float = 0.008) -> dict[str, object]:
    """Return what was seen in a picture, with the unit in every name.

    Args:
        view: what was seen.
        limit_m: the sigma up to which a place is certain enough [m].
    """
    verdicts = [it.judge(limit_m) for it in view.located]
    return {
        "found": bool(view.located),
        "objects": [
            {
                "target": it.target,
                "box_px": it.box_px,
                "depth_m": it.depth_m,
                "depth_sigma_m": it.depth_sigma_m,
                "p_camera_m": it.p_camera,
                "p_base_m": it.p_base,
                "sigma_m": it.sigma_m,
                "certain": verdict.good,
                "budget_m": {
                    cause.name.lower(): sigma for cause, sigma in verdict.by_cause.items()
                },
                "verdict": verdict.sentence,
            }
            for it, verdict in zip(view.located, verdicts, strict=True)
        ],
        "refused": [
            {"target": it.target, "box_px": it.box_px, "reason": it.reason} for it in view.refused
        ],
    }


def to_json(report: object) -> str:
    """Return strict JSON: arrays become lists, and a number that is not finite becomes null."""
    return json.dumps(_plain(report), indent=2, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Enum):
        return _plain(value.value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "tolist"):  # a numpy array or number
        return _plain(value.tolist())
    return value if value is None or isinstance(value, bool | int | str) else str(value)
