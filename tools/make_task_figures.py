"""Draw the figures of docs/tasks.md: the states, the graspable region, and a table being sorted."""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from arm3dof.model.library import load_robot
from arm3dof.runtime.tasks.gripping import Grip, Gripping
from arm3dof.runtime.tasks.machine import TRANSITIONS, Event, Phase
from arm3dof.runtime.tasks.simulated import SimulatedTask, task_targets
from arm3dof.runtime.tasks.sort_trial import TIME_LIMIT, random_table, sorting
from arm3dof.ui.style import STYLE
from arm3dof.vision.annotate import annotate
from arm3dof.vision.standing import Standing

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
INK, BLUE, ORANGE, GREEN, PALE = "#1b2733", "#0072b2", "#d55e00", "#009e73", "#eef3f7"
PLACES = {
    Phase.LOOK: (0, 3), Phase.DECIDE: (1, 3), Phase.APPROACH: (2, 3), Phase.REACH: (3, 3),
    Phase.CLOSE: (4, 3), Phase.LIFT: (4, 2), Phase.CARRY: (4, 1), Phase.LOWER: (4, 0),
    Phase.RELEASE: (3, 0), Phase.RETREAT: (2, 0), Phase.RETURN: (1, 0), Phase.RECOVER: (2, 1.5),
    Phase.DONE: (0, 1.15), Phase.FAILED: (1, 1.5),
}  # fmt: skip
WIDE, HIGH = 2.6, 1.5
BOX = (0.62, 0.22)
BENDS = {
    (Phase.DECIDE, Phase.LOOK): 0.35,
    (Phase.RETURN, Phase.LOOK): -0.8,
    (Phase.LIFT, Phase.LOWER): -0.55,
}


def main() -> None:
    """Write docs/images/task-*.png and sort.jpg."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=IMAGES)
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(dict(STYLE)):
        draw_states().savefig(folder / "task-states.png", dpi=110)
        draw_region().savefig(folder / "task-region.png", dpi=110)
    cv2.imwrite(str(folder / "sort.jpg"), sort_strip(), [cv2.IMWRITE_JPEG_QUALITY, 86])


def draw_states() -> plt.Figure:
    """Draw the table of transitions: the good way in blue, what goes wrong in orange."""
    figure, axes = plt.subplots(figsize=(11, 6.4), layout="constrained")
    axes.set(xlim=(-1.7, 4 * WIDE + 1.4), ylim=(-0.55, 3 * HIGH + 0.45))
    axes.axis("off")
    for phase, row in TRANSITIONS.items():
        targets: dict[Phase, list[Event]] = {}
        for event, target in row.items():
            targets.setdefault(target, []).append(event)
        for target, events in targets.items():
            arrow(axes, phase, target, events)
    for phase in Phase:
        x, y = place(phase)
        colour = {Phase.DONE: GREEN, Phase.FAILED: ORANGE, Phase.RECOVER: ORANGE}.get(phase, BLUE)
        axes.add_patch(
            FancyBboxPatch(
                (x - BOX[0], y - BOX[1]), 2 * BOX[0], 2 * BOX[1], facecolor=PALE,
                boxstyle="round,pad=0.02,rounding_size=0.12", edgecolor=colour, linewidth=1.8,
            )
        )  # fmt: skip
        axes.text(
            x, y, phase.value, ha="center", va="center", color=INK, fontsize=12, weight="bold"
        )
    return figure


def arrow(axes: plt.Axes, source: Phase, target: Phase, events: list[Event]) -> None:
    """Draw one arrow with the names of its events."""
    start, end = np.array(place(source)), np.array(place(target))
    bad = target in (Phase.RECOVER, Phase.FAILED) or events[0] in (Event.LOOK_AGAIN, Event.NO_WAY)
    colour = ORANGE if bad else BLUE
    bend = BENDS.get((source, target), 0.0)
    axes.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle="-|>", mutation_scale=14, color=colour, linewidth=1.3,
            shrinkA=34, shrinkB=34, connectionstyle=f"arc3,rad={bend}", zorder=0,
        )
    )  # fmt: skip
    if target is Phase.RECOVER and source is not Phase.CARRY:
        return  # the same words as at the one that is labelled
    middle = (start + end) / 2
    aside = np.array([-(end - start)[1], (end - start)[0]]) * -bend / 2
    words = "\n".join(event.value.replace("_", " ") for event in events)
    axes.text(
        *(middle + aside), words, ha="center", va="center", fontsize=8.5, color=colour,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2, "alpha": 0.9},
    )  # fmt: skip


def place(phase: Phase) -> tuple[float, float]:
    """Return where a phase is drawn."""
    x, y = PLACES[phase]
    return x * WIDE, y * HIGH


def draw_region() -> plt.Figure:
    """Draw at which height a thing is grasped, over its distance and its height."""
    gripping = Gripping(load_robot("arm3dof"), -0.11)
    radii, heights = np.linspace(0.08, 0.26, 37), np.linspace(0.012, 0.10, 30)
    grasp, slant = np.full((len(heights), len(radii)), np.nan), np.full(len(radii), np.nan)
    for i, height in enumerate(heights):
        for k, radius in enumerate(radii):
            found = gripping.grip(Standing("", radius, 0.0, 0.03, height, 1e-6 * np.eye(2)))
            if isinstance(found, Grip):
                grasp[i, k], slant[k] = 1000 * found.height, -np.degrees(found.pitch)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    mesh = left.pcolormesh(1000 * radii, 1000 * heights, grasp, cmap="viridis")
    figure.colorbar(mesh, ax=left, label="height of the grasp [mm]")
    left.set(
        xlabel="distance from the base's axis [mm]", ylabel="height of the thing [mm]",
        title="Where a thing 30 mm wide is grasped", facecolor="#f3f3f3",
    )  # fmt: skip
    right.plot(1000 * radii, slant, color=BLUE, linewidth=2)
    right.set(
        xlabel="distance from the base's axis [mm]", ylabel="slant of the forearm [deg]",
        title="How steeply the hand comes down",
    )  # fmt: skip
    left.grid(visible=False)
    return figure


def sort_strip() -> np.ndarray:
    """Sort a table, and put four of the camera's pictures together, from its start to its end."""
    rng = np.random.default_rng(4)
    world = random_table(rng)
    pictures: list[np.ndarray] = []
    with SimulatedTask(
        load_robot("arm3dof"), world, task_targets([tray.name for tray in world.bins]), rng
    ) as scene:
        lifts = 0

        def watch(state: object, answer: object, phase: Phase) -> None:
            nonlocal lifts
            if phase is Phase.CARRY and watch.last is not Phase.CARRY:
                lifts += 1
                if lifts in (3, 6):
                    pictures.append(scene.picture())
            watch.last = phase

        watch.last = Phase.LOOK
        scene.run(sorting(world), time_limit=TIME_LIMIT, watch=watch)
        first = scene.eye.first
        pictures = [annotate(first.image, first.view), *pictures, scene.picture()]
    small = [cv2.resize(it, (480, 360), interpolation=cv2.INTER_AREA) for it in pictures]
    gap = np.full((360, 8, 3), 255, np.uint8)
    rows = [np.concatenate([a, gap, b], axis=1) for a, b in (small[:2], small[2:])]
    return np.concatenate([rows[0], np.full((8, rows[0].shape[1], 3), 255, np.uint8), rows[1]])


if __name__ == "__main__":
    main()
