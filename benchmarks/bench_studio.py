"""The studio live: does the arm keep its time while people look, and how fluent is the page?"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

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
from arm3dof.ui.studio.site import WATCHED, build_site
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
_WARM, _LONG = 60.0, 1200.0  # s: to warm up, and how long memory is watched then
_ALONE = 30.0  # s: how long one tab is watched before the others are opened
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
    """Measure for twenty minutes, after one to warm up; for ten seconds when quick."""
    warm, duration, alone = (0.0, 10.0, 5.0) if quick else (_WARM, _LONG, _ALONE)
    robot = load_robot()
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, _visitor() as visitor:
        eye = eye_spec("world", None)
        studio = Studio(Tuned(), robot, home(robot), eye, Path(folder), file_store())
        try:
            with LocalServer(build_site(studio), watched=WATCHED) as server:
                _open(visitor, server.url)
                first = time.perf_counter() - begin
                _watch(studio, visitor, alone / 3)  # it finds out how coarsely it has to draw
                single = _watch(studio, visitor, alone).rates
                for _ in range(TABS - 1):
                    _open(visitor, server.url)
                _watch(studio, visitor, warm)
                watched = _watch(studio, visitor, duration)
        finally:
            studio.close()
    return [
        _start(2 if quick else STARTS),
        _arm(watched.wakes, duration),
        _page(first, {"one tab": single, f"the last of {TABS} tabs": watched.rates}),
        _kept(watched.memory, duration),
    ]


@contextmanager
def _visitor() -> Iterator[Connection]:
    """Whoever visits the page, in a process of its own, for it holds more from minute to minute.

    It is sent addresses, which it opens in another tab each, or nothing, and answers each time with
    what the last tab has counted.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_visit, args=(theirs,), name="visitor")
    process.start()
    theirs.close()
    try:
        yield ours
    finally:
        ours.close()
        process.join()


def _visit(line: Connection) -> None:
    """Open what is asked for, until nobody asks any more."""
    with chromium() as browser:
        page = None
        while True:
            while page is not None and not line.poll():
                page.wait_for_timeout(100)  # the browser's events wait as well
            try:
                url = line.recv()
            except EOFError:
                return
            if url:
                page = browser.new_page(viewport={"width": 1280, "height": 720})
                page.goto(url, wait_until="domcontentloaded")
                page.wait_for_function(_WORKS, timeout=60_000)
            line.send(page.evaluate(_COUNT))


def _open(visitor: Connection, url: str) -> None:
    """Let the page be opened in another tab, and return when it shows all that it has."""
    visitor.send(url)
    visitor.recv()


def _count(visitor: Connection) -> dict[str, float]:
    """Return what the last tab has drawn so far, and its time [s]."""
    visitor.send("")
    counted: dict[str, float] = visitor.recv()
    return counted


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


class Watched(NamedTuple):
    """What was seen of a moving arm and its page.

    Attributes:
        rates: of charts, pictures and views [1/s].
        wakes: of ``wake_ups``.
        memory: of the processes, at the beginning and after each minute, shape (n, 3) [MiB].
    """

    rates: dict[str, float]
    wakes: np.ndarray
    memory: np.ndarray


def _watch(studio: Studio, visitor: Connection, duration: float) -> Watched:
    """Keep the arm moving, and watch."""
    start, turn, count = time.monotonic(), 0, studio.arm.ring.count
    # all that is kept of the frames is there from the beginning, for memory is watched
    wakes, kept = np.full((int(100 * duration) + 1000, 3), np.nan), 0
    before = _count(visitor)
    memory = [_memory(studio)]
    due = start
    while (now := time.monotonic()) < start + duration:
        if now >= due:
            due += _PERIOD
            studio.ask(cmd.Aim(_MOVES[turn % len(_MOVES)]))
            studio.ask(cmd.Run())
            turn += 1
        if now >= start + 60 * len(memory):
            memory.append(_memory(studio))
        time.sleep(0.25)
        count, new = studio.arm.ring.since(count)
        wakes[kept : kept + len(new)] = wake_ups(new)
        kept += len(new)
    memory.append(_memory(studio))
    after = _count(visitor)
    seconds = after["t"] - before["t"]
    rates = {key: (after[key] - before[key]) / seconds for key in ("charts", "pictures", "frames")}
    return Watched(rates, wakes[:kept], np.array(memory))


def wake_ups(frames: Frames) -> np.ndarray:
    """Return lateness [s], whether it was a control step, and the count of misses, shape (n, 3).

    Only that is kept of the frames: those of ten minutes would take 100 MB.
    """
    return np.column_stack([frames[name] for name in ("lateness", "control", "missed")])


def _memory(studio: Studio) -> list[float]:
    """Return what this process, which has the page's server, the arm's and the eye's hold [MiB]."""
    pids = (None, studio.arm.pid, studio.eye.pid)
    return [psutil.Process(pid).memory_info().rss / 2**20 for pid in pids]


def _arm(wakes: np.ndarray, duration: float) -> Table:
    lateness, is_control, missed = wakes.T
    rows = []
    for name, late in (("every frame", lateness), ("control steps", lateness[is_control == 1])):
        p50, p99 = np.percentile(1e3 * late, [50, 99])
        rows.append((name, f"{len(late)}", f"{p50:.2f}", f"{p99:.2f}", f"{1e3 * late.max():.2f}"))
    return Table(
        f"The studio's arm, {duration:.0f} s with {TABS} tabs open: how late it wakes",
        ("wake-ups", "count", "p50 [ms]", "p99 [ms]", "max [ms]"),
        rows,
        f"Missed deadlines: {missed[-1] - missed[0]:.0f}. "
        f"Load average: {psutil.getloadavg()[0]:.1f}.",
    )


def _page(first: float, seen: dict[str, dict[str, float]]) -> Table:
    names = {"charts": "charts", "pictures": "camera", "frames": "3-D view"}
    return Table(
        "The studio's page in headless Chromium without a GPU, the arm never at rest",
        ("how often it draws [1/s]", *seen),
        [(name, *(f"{rates[it]:.1f}" for rates in seen.values())) for it, name in names.items()],
        f"Start to the first tab's first picture: {first:.1f} s.",
    )


def _kept(memory: np.ndarray, duration: float) -> Table:
    names = ("the page's server", "the arm", "the eye", "together")
    columns = np.column_stack([memory, memory.sum(axis=1)]).T
    return Table(
        f"Memory of the studio over {duration:.0f} s with {TABS} tabs open, a sample each minute",
        ("process", "first [MiB]", "last [MiB]", "most [MiB]", "growth"),
        [
            (
                name,
                f"{column[0]:.1f}",
                f"{column[-1]:.1f}",
                f"{column.max():.1f}",
                f"{100 * (column[-1] / column[0] - 1):+.1f} %",
            )
            for name, column in zip(names, columns, strict=True)
        ],
    )
