"""What the studio does in the long run: an hour passes, people come and go, and nothing grows."""

from __future__ import annotations

import gc
import http.client
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest
from studio import Program, studio
from websockets.sync.client import connect

from arm3dof.model.library import load_robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.arm import LiveArm
from arm3dof.runtime.live.frames import Ring, frame_type
from arm3dof.runtime.live.pace import SimulatedClock, lateness_percentiles
from arm3dof.runtime.live.plants import RigidPlant
from arm3dof.runtime.live.process import ArmLoop
from arm3dof.ui.studio import feed
from arm3dof.ui.studio.keep import Runs
from arm3dof.ui.studio.scene import LiveScene
from arm3dof.ui.studio.visitors import MOST

pytestmark = pytest.mark.slow
HOUR, TEN_MINUTES = 3600.0, 600.0  # [s]
COARSE = 0.01  # [s]: the plant's step, that an hour may pass in a minute


def resident() -> float:
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20


@pytest.mark.parametrize("length", [TEN_MINUTES, pytest.param(HOUR, marks=pytest.mark.studio)])
def test_memory_is_flat_over_simulated_time(length: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arm3dof.runtime.live.arm.FRAME_RATE", 20.0)  # frames cost most of it
    robot = load_robot()
    arm = LiveArm(RigidPlant(robot, COARSE), np.zeros(3), cmd.Control(mpc={"dt": 0.1}))
    ring = Ring(arm.kind, lambda code, size: bytearray(size))
    rng = np.random.default_rng(0)
    mail: list[cmd.Command] = []

    def take() -> list[cmd.Command]:
        letters, mail[:] = mail[:] or [cmd.Alive()], []
        return letters

    loop = ArmLoop(arm, ring, take, lambda news: None, SimulatedClock())
    scene, runs = LiveScene(robot, np.zeros(3)), Runs()
    count, after_five = 0, 0.0
    for tenth in range(int(length / 10)):
        mail += [
            cmd.Aim((rng.uniform(-0.8, 0.8), rng.uniform(0.2, 1.8), rng.uniform(-0.8, 0.8))),
            cmd.Run(),
        ]
        end = 10.0 * (tenth + 1)
        while arm.plant.state.t < end - 1e-9:
            loop.tick()
        count, frames = ring.since(count)
        runs.add(frames)
        scene.show(frames[-1])
        scene.show_trail(frames)
        feed.numbers_message(frames[-6:], robot, lateness_percentiles(frames["lateness"]), {})
        if end == 300.0:
            after_five = resident()
    assert resident() < 1.05 * after_five
    assert arm.plant.state.t == pytest.approx(length)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with studio(tmp_path_factory.mktemp("studio")) as running:
        yield running


@pytest.mark.parametrize("count", [150, pytest.param(600, marks=pytest.mark.studio)])
def test_listeners_leave_no_trace(count: int, program: Program) -> None:
    server = psutil.Process(program.pid)
    for number in range(count):
        path = "live" if number % 2 else "3d/scene"
        address = f"ws://127.0.0.1:{program.port}/{path}"
        with connect(address, proxy=None, max_size=None, open_timeout=30) as client:
            client.recv(timeout=30)
        if number == 60:
            memory, files = server.memory_info().rss, server.num_fds()
    assert server.memory_info().rss < 1.05 * memory
    assert server.num_fds() <= files + 2


def test_the_benchmark_keeps_little_of_what_it_watches() -> None:
    from benchmarks.bench_studio import wake_ups

    frames = np.zeros(100, frame_type(3, bodies=3))
    frames["lateness"], frames["control"] = np.arange(100), 1
    kept = wake_ups(frames)
    np.testing.assert_array_equal(kept[:, 0], np.arange(100))
    assert kept.base is None
    assert kept.nbytes <= 24 * len(frames)


# ---- pages that come and go ----------------------------------------------------------------------

COUNTED = """
import gc, json, sys
from pathlib import Path
import numpy as np
import psutil
from nicegui import Client
from arm3dof.cli.studio import file_store
from arm3dof.config.camera_file import load_camera
from arm3dof.model.library import load_robot
from arm3dof.runtime.live.eye import Watch
from arm3dof.runtime.live.eye_process import EyeSpec
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.ui.demo_scene import demo_table
from arm3dof.ui.server import LocalServer
from arm3dof.ui.studio.site import WATCHED, build_site
from arm3dof.ui.studio.studio import Studio
robot = load_robot()
eye = EyeSpec(load_camera("desk").camera, Watch(()), demo_table(np.random.default_rng(0)))
live = Studio(Tuned(), robot, np.zeros(robot.nv), eye, Path(sys.argv[1]), file_store())
try:
    with LocalServer(build_site(live), watched=WATCHED) as server:
        print(server.port, flush=True)
        for _ in sys.stdin:
            gc.collect()
            memory = psutil.Process().memory_info().rss
            print(json.dumps([len(Client.instances), memory]), flush=True)
finally:
    live.close()
"""


class Counted:
    """A studio in a process of its own, that says how many pages it keeps."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", COUNTED, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        self.port = int(self._process.stdout.readline())

    def ask(self, path: str) -> tuple[int, str]:
        """The status and the body of an answer."""
        with closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)) as line:
            line.request("GET", path)
            answer = line.getresponse()
            return answer.status, answer.read().decode()

    def load(self) -> str:
        """Load the page, and return the name that it has there."""
        status, body = self.ask("/")
        assert status == 200
        return re.search(r"client_id[^0-9a-f]+([0-9a-f-]{36})", body)[1]

    @contextmanager
    def enter(self, name: str) -> Iterator[bool]:
        """Be connected as a browser that has loaded the page, and tell whether it was known."""
        words = f"EIO=4&transport=websocket&client_id={name}&implicit_handshake=true"
        address = f"ws://127.0.0.1:{self.port}/_nicegui_ws/socket.io/?{words}"
        ids = f"&next_message_id=0&tab_id={name}&document_id={name}"
        with connect(address + ids, proxy=None, max_size=None, open_timeout=60) as page:
            page.recv(timeout=60)
            page.send("40")
            while not (said := str(page.recv(timeout=60))).startswith("4"):
                if said == "2":
                    page.send("3")
            yield said.startswith("40")

    def count(self) -> tuple[int, float]:
        """How many pages it keeps, and its memory [MiB]."""
        self._process.stdin.write("?\n")
        pages, memory = json.loads(self._process.stdout.readline())
        return pages, memory / 2**20

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait(60)
        self._process.stdout.close()


@pytest.fixture
def counted(tmp_path: Path) -> Iterator[Counted]:
    running = Counted(tmp_path)
    yield running
    running.close()


@pytest.mark.parametrize("loads", [60, pytest.param(200, marks=pytest.mark.studio)])
def test_page_loads_leave_no_growth(loads: int, counted: Counted) -> None:
    memory = 0.0
    for number in range(1, loads + 1):
        last = counted.load()
        if number % (loads // 3) == 0:
            pages, now = counted.count()
            print(f"{number} loads: {pages} pages kept, {now:.0f} MiB")
            assert pages <= MOST
            memory = memory or now
    assert now < 1.05 * memory
    with counted.enter(last) as known:  # the last one is still waited for
        assert known


def test_tabs_that_come_and_go_are_forgotten(counted: Counted) -> None:
    kept, _ = counted.count()
    for _ in range(30):
        with counted.enter(counted.load()) as known:
            assert known
            assert counted.count()[0] > kept
    end = time.monotonic() + 60  # each has some seconds to come back
    while counted.count()[0] > kept:
        assert time.monotonic() < end


def test_a_tab_that_stays_outlives_a_burst_of_loads(counted: Counted) -> None:
    with counted.enter(counted.load()):
        early = counted.load()
        for _ in range(MOST):
            counted.load()
        assert counted.count()[0] == MOST + 1
        with counted.enter(early) as known:  # given up: its browser is told, and loads it anew
            assert not known
        assert counted.count()[0] == MOST + 1


def test_pages_that_there_are_not_cost_nothing(counted: Counted) -> None:
    before, _ = counted.count()
    for path in ("/nothing", "/nothing/here", "/_nicegui/x", "/studio/studio.map") * 10:
        status, body = counted.ask(path)
        assert status == 404
        assert len(body) < 100
    assert counted.count()[0] == before
