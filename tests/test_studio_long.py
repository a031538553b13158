"""What the studio does in the long run: an hour passes, people come and go, and nothing grows."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import numpy as np
import psutil
import pytest
from studio import Program, studio
from websockets.sync.client import connect

from arm3dof.model.library import load_robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.arm import LiveArm
from arm3dof.runtime.live.frames import Ring
from arm3dof.runtime.live.pace import SimulatedClock
from arm3dof.runtime.live.plants import RigidPlant
from arm3dof.runtime.live.process import ArmLoop
from arm3dof.ui.studio import feed
from arm3dof.ui.studio.keep import Runs
from arm3dof.ui.studio.scene import LiveScene

pytestmark = pytest.mark.slow
HOUR, QUARTER = 3600.0, 900.0  # [s]
COARSE = 0.01  # [s]: the plant's step, that an hour may pass in a minute


def resident() -> float:
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20


@pytest.mark.parametrize("length", [QUARTER, pytest.param(HOUR, marks=pytest.mark.studio)])
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
        feed.numbers_message(frames[-6:], robot, frames["lateness"], {})
        if end == 300.0:
            after_five = resident()
    assert resident() < 1.05 * after_five
    assert arm.plant.state.t == pytest.approx(length)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with studio(tmp_path_factory.mktemp("studio")) as running:
        yield running


def test_six_hundred_listeners_leave_no_trace(program: Program) -> None:
    server = psutil.Process(program.pid)
    for number in range(600):
        path = "live" if number % 2 else "3d/scene"
        address = f"ws://127.0.0.1:{program.port}/{path}"
        with connect(address, proxy=None, max_size=None, open_timeout=30) as client:
            client.recv(timeout=30)
        if number == 60:
            memory, files = server.memory_info().rss, server.num_fds()
    assert server.memory_info().rss < 1.05 * memory
    assert server.num_fds() <= files + 2
