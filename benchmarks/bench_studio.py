"""The studio live: does the arm keep its time while people look, and how fluent is the page?"""

from __future__ import annotations

import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import psutil
from websockets.sync.client import connect

from arm3dof.cli.studio import eye_spec, file_store
from arm3dof.model.library import load_robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.frames import Frames
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.ui.server import LocalServer
from arm3dof.ui.studio import feed
from arm3dof.ui.studio.site import build_site
from arm3dof.ui.studio.start import home
from arm3dof.ui.studio.studio import Studio
from benchmarks.tables import Table

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from browser import chromium
from studio import studio as program

TABS = 3
STARTS = 5
_MOVES = ((0.5, 1.6, -1.5), (-0.5, 1.5, -1.2), (0.0, 1.9, -1.8))  # [rad]
_PERIOD = 0.6  # s: how often the arm gets another target, so that it never rests
_WORKS = """() => studio.live.last && studio.live.pictures > 0
  && document.getElementById("view").contentWindow.viewer"""
_COUNT = """() => {
  const view = document.getElementById("view").contentWindow;
  const count = window.counted ??= { frames: 0, start: performance.now() };
  if (!view.counting) {
    view.counting = true;
    const render = view.viewer.render;
    view.viewer.render = function () { count.frames += 1; render.call(this); };
  }
  return { t: performance.now() / 1000, charts: studio.charts.drawn,
           pictures: studio.live.pictures, frames: count.frames };
}"""


def run(*, quick: bool) -> list[Table]:
    """Measure for ten minutes; for ten seconds when quick."""
    duration = 10.0 if quick else 600.0
    robot = load_robot()
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        eye = eye_spec("world", None)
        studio = Studio(Tuned(), robot, home(robot), eye, Path(folder), file_store())
        try:
            with LocalServer(build_site(studio)) as server:
                pages = []
                for _ in range(TABS):
                    page = browser.new_page(viewport={"width": 1280, "height": 720})
                    page.goto(server.url, wait_until="domcontentloaded")
                    page.wait_for_function(_WORKS, timeout=60_000)
                    if not pages:
                        first = time.perf_counter() - begin
                    pages.append(page)
                rates, frames, memory = _watch(studio, pages[-1], duration)
        finally:
            studio.close()
    return [_start(2 if quick else STARTS), _arm(frames, duration), _page(rates, first, memory)]


def _start(times: int) -> Table:
    """Start the program as a person does, and wait for what a page waits for."""
    with tempfile.TemporaryDirectory() as folder:
        starts = np.array([_start_once(Path(folder)) for _ in range(times)])
    names = (
        "the page answers [s]",
        "the page has been sent [s]",
        "the arm's first numbers [s]",
        "the camera's first picture [s]",
        "processor time until then, all processes [s]",
    )
    rows = [
        (name, f"{np.median(column):.2f}", f"{column.min():.2f}")
        for name, column in zip(names, starts.T, strict=True)
    ]
    return Table(
        f"The studio's start: the program with its imports, {times} times",
        ("from the command to", "median", "best"),
        rows,
        f"Load average: {psutil.getloadavg()[0]:.1f}.",
    )


def _start_once(folder: Path) -> list[float]:
    begin = time.perf_counter()
    with program(folder) as running:
        marks = [time.perf_counter() - begin]
        with urllib.request.urlopen(running.url) as page:
            page.read()
        marks.append(time.perf_counter() - begin)
        first: dict[bytes, float] = {}
        with connect(f"ws://127.0.0.1:{running.port}/live", proxy=None, max_size=None) as line:
            while not {feed.NUMBERS, feed.PICTURE} <= first.keys():
                first.setdefault(bytes(line.recv(timeout=60)[:1]), time.perf_counter() - begin)
        me = psutil.Process(running.pid)
        spent = [sum(it.cpu_times()[:2]) for it in (me, *me.children(recursive=True))]
    return [*marks, first[feed.NUMBERS], first[feed.PICTURE], sum(spent)]


def _watch(studio: Studio, page: object, duration: float) -> tuple[dict, list[Frames], list[float]]:
    """Keep the arm moving, and collect its frames and the page's counts."""
    end, turn, count = time.monotonic() + duration, 0, studio.arm.ring.count
    frames: list[Frames] = []
    memory = []
    before = page.evaluate(_COUNT)
    due = time.monotonic()
    while time.monotonic() < end:
        if time.monotonic() >= due:
            due += _PERIOD
            studio.ask(cmd.Aim(_MOVES[turn % len(_MOVES)]))
            studio.ask(cmd.Run())
            memory.append(_memory())
            turn += 1
        page.wait_for_timeout(250)  # and not time.sleep, for the browser's events wait as well
        count, new = studio.arm.ring.since(count)
        frames.append(new)
    after = page.evaluate(_COUNT)
    seconds = after["t"] - before["t"]
    rates = {key: (after[key] - before[key]) / seconds for key in ("charts", "pictures", "frames")}
    return rates, frames, memory


def _memory() -> float:
    """Return what the page's process, the arm's and the eye's hold [MiB]."""
    me = psutil.Process()
    family = [me, *(it for it in me.children(recursive=True) if "chrom" not in it.name())]
    return sum(it.memory_info().rss for it in family) / 2**20


def _arm(parts: list[Frames], duration: float) -> Table:
    frames = np.concatenate(parts)
    controlled = frames[frames["control"] == 1]
    missed = int(frames["missed"][-1] - frames["missed"][0])
    rows = []
    for name, column in (("every frame", frames), ("control steps", controlled)):
        late = 1e3 * column["lateness"]
        p50, p99 = np.percentile(late, [50, 99])
        rows.append((name, f"{len(late)}", f"{p50:.2f}", f"{p99:.2f}", f"{late.max():.2f}"))
    return Table(
        f"The studio's arm, {duration:.0f} s with {TABS} tabs open: how late it wakes",
        ("wake-ups", "count", "p50 [ms]", "p99 [ms]", "max [ms]"),
        rows,
        f"Missed deadlines: {missed}. Load average: {psutil.getloadavg()[0]:.1f}.",
    )


def _page(rates: dict[str, float], first: float, memory: list[float]) -> Table:
    grown = 100 * (np.mean(memory[-3:]) / np.mean(memory[:3]) - 1)
    return Table(
        "The studio's page in headless Chromium without a GPU, the last tab of three",
        ("what", "measured"),
        [
            ("start to the first picture [s]", f"{first:.1f}"),
            ("charts [1/s]", f"{rates['charts']:.1f}"),
            ("camera [1/s]", f"{rates['pictures']:.1f}"),
            ("3-D view [1/s]", f"{rates['frames']:.1f}"),
            ("memory of page, arm and eye [MiB]", f"{memory[-1]:.0f} ({grown:+.1f} %)"),
        ],
    )
