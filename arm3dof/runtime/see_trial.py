"""One trial of seeing: a random table, a picture of it, and how far off the eye is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError, MissingExtra
from arm3dof.runtime.campaign import Campaign, Figures, Outcome
from arm3dof.runtime.table_scenes import Placed, TableScene, random_scene
from arm3dof.sim.scene import draw
from arm3dof.vision.locate import Located, View, look

KINDS = {
    "drawn": ("ball", "cylinder", "cube", "card"),
    "physics": ("cylinder", "cube", "bottle"),
}
"""What each renderer can show."""
_GAMMAS = {"drawn": 2.2, "physics": 1.5}  # that their edges look most like
NEAR = 0.03
"""What is located further than this from every object of its colour is a false object [m]."""
TOLERANCE = 0.008
"""An object located further off than this is a failure of its trial [m]."""
_INTERVAL_90 = 6.251388631170325  # of chi-squared with 3 degrees of freedom


@dataclass(frozen=True)
class SeeTrial:
    """A random table scene that the eye looks at.

    Attributes:
        renderer: ``"drawn"`` casts rays, ``"physics"`` is MuJoCo's camera.

    Raises:
        InputError: there is no such renderer.
        MissingExtra: it needs MuJoCo, which is not installed.
    """

    renderer: str = "drawn"

    def __post_init__(self) -> None:
        if self.renderer not in KINDS:
            raise InputError(f"no renderer '{self.renderer}'; give one of: {', '.join(KINDS)}")
        if self.renderer == "physics" and find_spec("mujoco") is None:
            raise MissingExtra("the renderer 'physics'", "physics")

    def __call__(self, rng: np.random.Generator) -> Outcome:
        """Set a table, take its picture, look at it and judge."""
        table = self.scene(rng)
        view = look(self.picture(table, rng), table.camera, table.targets)
        return judge(table, view)

    def scene(self, rng: np.random.Generator) -> TableScene:
        """Set a table of what the renderer can show."""
        table = random_scene(rng, KINDS[self.renderer])
        return replace(table, camera=replace(table.camera, gamma=_GAMMAS[self.renderer]))

    def picture(self, table: TableScene, rng: np.random.Generator) -> NDArray[np.uint8]:
        """Take the table's picture, BGR, shape (h, w, 3)."""
        camera = table.camera
        if self.renderer == "physics":
            from arm3dof.runtime.physics_picture import photograph  # MuJoCo is an extra

            return photograph(table, rng)
        return draw(
            table.scene,
            camera.camera_matrix,
            camera.transform_base_camera,
            camera.width,
            camera.height,
            rng,
        )


def judge(table: TableScene, view: View) -> Outcome:
    """Compare what was seen with what is there."""
    reasons: list[str] = []
    errors: list[float] = []
    squares: list[float] = []
    left = list(view.located)
    for placed in table.placed:
        seen = _nearest(placed, left)
        if seen is None:
            reasons.append(_why_not_seen(placed, view))
            continue
        left.remove(seen)
        miss = seen.p_base - placed.centre
        errors.append(float(np.linalg.norm(miss)))
        squares.append(float(miss @ np.linalg.solve(seen.covariance_base, miss)))
        if errors[-1] > TOLERANCE:
            reasons.append(f"{_name(placed)} is {1000 * errors[-1]:.1f} mm off")
    reasons += [f"{seen.target} seen where there is none" for seen in left]
    figures: Figures = {
        "objects": len(table.placed),
        "found": len(errors),
        "false_objects": len(left),
        "error_m": errors,
        "squared_sigmas": squares,
    }
    return Outcome("; ".join(reasons), figures)


def see_report(campaign: Campaign) -> dict[str, Any]:
    """Return how well the eye sees: the campaign's report with its figures.

    ``coverage_90`` is the share of objects whose centre lies in the ellipsoid that the stated
    covariance gives nine in ten.
    """
    error = campaign.column("error_m")
    seen = error.size > 0
    figures = {
        "objects": int(campaign.column("objects").sum()),
        "recall": float(campaign.column("found").sum() / campaign.column("objects").sum()),
        "false_objects": int(campaign.column("false_objects").sum()),
        "median_error_m": float(np.median(error)) if seen else None,
        "p95_error_m": float(np.percentile(error, 95)) if seen else None,
        "coverage_90": float(np.mean(campaign.column("squared_sigmas") < _INTERVAL_90))
        if seen
        else None,
    }
    return campaign.report() | figures


def goals(report: Mapping[str, Any]) -> dict[str, bool]:
    """Return which goals a report of ``see_report`` reaches."""
    seen = report["median_error_m"] is not None
    return {
        "recall of 99 %": report["recall"] >= 0.99,
        "no false object": report["false_objects"] == 0,
        "median error of 3 mm": seen and report["median_error_m"] <= 0.003,
        "95th percentile of 8 mm": seen and report["p95_error_m"] <= TOLERANCE,
        "the 90 % interval holds in 85 to 95 %": seen and 0.85 <= report["coverage_90"] <= 0.95,
    }


def _nearest(placed: Placed, located: list[Located]) -> Located | None:
    """Return what was located nearest to an object, of its colour and not far off."""
    near = [
        (float(np.linalg.norm(it.p_base - placed.centre)), k)
        for k, it in enumerate(located)
        if it.target == placed.target.name
    ]
    distance, index = min(near, default=(np.inf, 0))
    return located[index] if distance < NEAR else None


def _why_not_seen(placed: Placed, view: View) -> str:
    refused = [it for it in view.refused if it.target == placed.target.name]
    return f"{_name(placed)} not seen" + "".join(f" ({it.reason.name.lower()})" for it in refused)


def _name(placed: Placed) -> str:
    return f"{placed.target.name} {placed.target.shape}"
