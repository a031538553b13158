"""What finding colours costs beside the OpenCV calls that it cannot do without."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.config.camera_file import load_camera
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.vision.colour import BlobSettings, ColourTarget, find_colours
from arm3dof.vision.locate import look
from benchmarks.tables import Table

COLOURS = ("red", "green", "blue")
PICTURES = 8

Image = NDArray[np.uint8]
Job = Callable[[Image], object]


def run(*, quick: bool) -> Table:
    """Time the jobs in turns on drawn tables, one thread each."""
    rounds = 5 if quick else 100
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        times = _times(rounds)
    finally:
        cv2.setNumThreads(threads)
    base = times["bare OpenCV calls"]
    rows = [
        (
            name,
            f"{1e3 * float(np.median(values)):.2f}",
            f"{1e3 * float(np.percentile(values, 99)):.2f}",
            f"{float(np.median(values) / np.median(base)):.2f}",
        )
        for name, values in times.items()
    ]
    return Table(
        "Three colours in 640 x 480",
        ("job", "p50 [ms]", "p99 [ms]", "ratio of p50"),
        rows,
        f"{PICTURES} drawn tables, {rounds} rounds in turns. The bare calls are GaussianBlur, "
        "cvtColor, and inRange, dilate and findContours for each colour (inRange twice for red).",
    )


def _times(rounds: int) -> dict[str, NDArray[np.float64]]:
    setup = load_camera("paper")
    targets = {name: setup.targets[name] for name in COLOURS}
    colours = [it.hsv for it in targets.values()]
    jobs: dict[str, Job] = {
        "bare OpenCV calls": lambda image: _bare(image, targets),
        "find_colours: patches": lambda image: find_colours(image, colours),
        "look: patches, outlines, points": lambda image: look(image, setup.camera, targets),
    }
    pictures = [draw_demo(setup.camera, np.random.default_rng(seed)) for seed in range(PICTURES)]
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for turn in range(rounds + 1):
        for picture in pictures:
            for name in list(jobs) if turn % 2 else list(reversed(jobs)):
                start = perf_counter()
                jobs[name](picture)
                if turn:  # the first round warms caches
                    times[name].append(perf_counter() - start)
    return {name: np.array(values) for name, values in times.items()}


def _bare(image: Image, targets: Mapping[str, ColourTarget]) -> None:
    settings = BlobSettings()
    grow = np.ones((2 * settings.dilate_px + 1, 2 * settings.dilate_px + 1), np.uint8)
    quiet = cv2.GaussianBlur(image, (settings.blur_px, settings.blur_px), 0)
    hsv = cv2.cvtColor(quiet, cv2.COLOR_BGR2HSV)
    for target in targets.values():
        low, high = target.hsv.low, target.hsv.high
        if target.hsv.wraps:
            mask = cv2.bitwise_or(
                cv2.inRange(hsv, low, (179, *high[1:])), cv2.inRange(hsv, (0, *low[1:]), high)
            )
        else:
            mask = cv2.inRange(hsv, low, high)
        cv2.findContours(cv2.dilate(mask, grow), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
