"""Draw the figures of docs/seeing.md: what the eye sees, and how far off it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from arm3dof.files import write_atomically
from arm3dof.runtime.campaign import trial_rng
from arm3dof.runtime.see_trial import SeeTrial
from arm3dof.runtime.table_scenes import FARTHEST, NEAREST, random_scene
from arm3dof.ui.plots import png
from arm3dof.ui.style import COLORS, SOFT, STYLE
from arm3dof.vision.annotate import annotate
from arm3dof.vision.budget import Cause, Table
from arm3dof.vision.camera import Doubt
from arm3dof.vision.locate import look

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
SHOWN = {"drawn": (3, 14, 22), "physics": (0, 3, 5)}
WIDTH, GAP = 1500, 8  # of the sheet of pictures [px]
SCENES = 220
BINS = 6
DOUBT = Doubt(focal_px=4.0, centre_px=2.0, position_m=0.0015, rotation_rad=np.deg2rad(0.3))
NAMES = {
    Cause.NOISE: "noise",
    Cause.EDGE: "light at the edges",
    Cause.WIDTH: "width",
    Cause.LENS: "lens",
    Cause.POSE: "camera's pose",
}


def main() -> None:
    """Write docs/images/seeing.jpg and seeing_error.png."""
    mpl.rcParams.update(STYLE)
    cv2.imwrite(str(IMAGES / "seeing.jpg"), sheet(), [cv2.IMWRITE_JPEG_QUALITY, 88])
    write_atomically(IMAGES / "seeing_error.png", png(error_figure()))


def sheet() -> NDArray[np.uint8]:
    """Put annotated pictures of both renderers side by side."""
    rows = []
    for renderer, numbers in SHOWN.items():
        trial, row = SeeTrial(renderer), []
        for number in numbers:
            rng = trial_rng(1, number)
            table = trial.scene(rng)
            picture = trial.picture(table, rng)
            row.append(annotate(picture, look(picture, table.camera, table.targets)))
        gap = np.full((row[0].shape[0], GAP, 3), 255, np.uint8)
        rows.append(np.hstack([row[0], gap, row[1], gap, row[2]]))
    whole = np.vstack([rows[0], np.full((GAP, rows[0].shape[1], 3), 255, np.uint8), rows[1]])
    height = round(whole.shape[0] * WIDTH / whole.shape[1])
    return np.asarray(cv2.resize(whole, (WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)


def error_figure() -> Figure:
    """Draw errors over distance, and what they are made of."""
    trial = SeeTrial()
    depths, errors, stood, sigmas, budgets = [], [], [], [], []
    for number in range(SCENES):
        rng = trial_rng(21, number)
        table = random_scene(rng, ("ball", "cylinder", "cube"), 1)
        picture, placed = trial.picture(table, rng), table.placed[0]
        camera = replace(table.camera, gamma=2.2)
        top = Table(table.scene.table.height, 0.001)
        free = look(picture, camera, [placed.target]).located
        on_top = look(picture, camera, [placed.target], table=top).located
        target = replace(placed.target, width_sigma_m=0.0003)
        doubted = look(picture, replace(camera, doubt=DOUBT), [target]).located
        if not (free and on_top and doubted):
            continue
        depths.append(float(camera.to_camera(placed.centre)[2]))
        errors.append(1000 * np.linalg.norm(free[0].p_base - placed.centre))
        stood.append(1000 * np.linalg.norm(on_top[0].p_base - placed.centre))
        sigmas.append(1000 * free[0].sigma_m)
        budgets.append({it: float(np.trace(c)) for it, c in doubted[0].budget.items()})
    figure = Figure(figsize=(10.5, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    depth = np.array(depths)
    draw_errors(left, depth, np.array(errors), np.array(stood), np.array(sigmas))
    draw_budget(right, depth, budgets)
    return figure


def draw_errors(
    axes: Axes,
    depth: NDArray[np.float64],
    errors: NDArray[np.float64],
    stood: NDArray[np.float64],
    sigmas: NDArray[np.float64],
) -> None:
    """Draw each object's error, and the sigma that the eye states."""
    axes.scatter(100 * depth, errors, s=14, color=COLORS[0], label="error", zorder=3)
    axes.scatter(
        100 * depth, stood, s=14, color=COLORS[2], label="error with the table's height", zorder=3
    )
    grid = np.linspace(NEAREST, FARTHEST, 40)
    stated = np.poly1d(np.polyfit(depth, sigmas, 2))(grid)
    axes.fill_between(
        100 * grid, 0, 2.15 * stated, color=SOFT, alpha=0.18, lw=0, label="nine in ten, as stated"
    )
    axes.set(
        xlabel="distance [cm]",
        ylabel="error [mm]",
        title="A camera that is known exactly",
        ylim=(0, 10),
    )
    axes.legend(loc="upper left")


def draw_budget(axes: Axes, depth: NDArray[np.float64], budgets: list[dict[Cause, float]]) -> None:
    """Draw the share of each cause in the variance, over distance."""
    edges = np.linspace(NEAREST, FARTHEST, BINS + 1)
    bins = np.clip(np.digitize(depth, edges) - 1, 0, BINS - 1)
    table = np.array([[budget[cause] for cause in NAMES] for budget in budgets])
    variance = np.array([table[bins == b].mean(axis=0) for b in range(BINS)])
    total = variance.sum(axis=1)
    parts = 1000 * variance / np.sqrt(total)[:, None]
    foot = np.cumsum(parts, axis=1) - parts
    for k, (colour, name) in enumerate(zip(COLORS, NAMES.values(), strict=False)):
        middles = 50 * (edges[1:] + edges[:-1])
        axes.bar(middles, parts[:, k], 6.2, foot[:, k], color=colour, label=name)
    axes.set(
        xlabel="distance [cm]",
        ylabel="sigma, shared out by variance [mm]",
        title="A camera and a width with doubts",
    )
    axes.legend(loc="upper left")


if __name__ == "__main__":
    main()
