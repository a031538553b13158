"""What the studio's processes load, and when: the sooner, the sooner the arm moves."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import psutil
import pytest
from test_import_cost import loaded_after

from arm3dof.runtime.live.child import Child

pytest.importorskip("nicegui")


def test_the_page_loads_no_clients_and_hides_none_from_others() -> None:
    code = "import arm3dof.ui.studio.site as site; from arm3dof.ui.studio.lean import UNUSED"
    assert not loaded_after(code) & {"aiohttp", "requests", "tornado", "websocket"}
    assert "json" in loaded_after(
        "import sys, json; from arm3dof.ui.studio.lean import without_clients\n"
        "with without_clients(): import json as again\n"
        "assert not set(sys.modules) & {'aiohttp', 'requests', 'tornado', 'websocket'}\nimport json"
    )


def test_what_is_loaded_ahead_draws_nothing_and_leaves_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setenv("MUJOCO_GL", "egl")
    code = "import arm3dof.runtime.live.ahead, os; assert os.environ['MUJOCO_GL'] == 'egl'"
    modules = loaded_after(code)
    assert {"arm3dof.runtime.live.process", "arm3dof.runtime.live.eye", "mujoco"} <= modules
    assert not {name for name in modules if name.partition(".")[0] in ("OpenGL", "nicegui")}


def test_a_child_has_this_environment_and_where_it_is_forked_everything_loaded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("ARM3DOF_TEST", "after the server's start")
    answers: list[tuple[bool, int, str]] = []
    child = Child("test", _tell, (), answers.append)
    child.close(patience=60.0)
    (loaded, threads, text), *_ = answers
    assert (loaded, threads) == (True, 1) or sys.platform != "linux"
    assert text == "after the server's start"


def _tell(pipe) -> None:
    loaded = "arm3dof.runtime.live.ahead" in sys.modules
    pipe.send((loaded, psutil.Process().num_threads(), os.environ["ARM3DOF_TEST"]))
    pipe.recv()


REHEARSED = """
import json, sys
import numpy as np
from arm3dof.control import kalman
from arm3dof.model.library import load_robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.process import ArmSpec, rehearse
from arm3dof.runtime.parallel import PackedRobot

spec = ArmSpec(PackedRobot.of(load_robot()), (0.0, 1.5, -1.5))
arm = spec.build()
arm.advance()
rehearse(spec)
known, tables = set(sys.modules), kalman.gains.cache_info().misses
arm.obey(cmd.Aim((-0.5, 0.5, 0.3)))
arm.obey(cmd.Run())
for _ in range(40):
    arm.advance()
print(json.dumps([sorted(set(sys.modules) - known), kalman.gains.cache_info().misses - tables]))
"""


def test_after_its_rehearsal_the_arm_does_nothing_for_the_first_time() -> None:
    done = subprocess.run([sys.executable, "-c", REHEARSED], capture_output=True, check=True)
    assert json.loads(done.stdout) == [[], 0]


WATCHED = """
import gc, json, tempfile, threading
from pathlib import Path
from types import SimpleNamespace
from urllib.request import urlopen
from arm3dof.cli.studio import eye_spec, file_store
from arm3dof.model.library import load_robot
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.ui.server import LocalServer
from arm3dof.ui.studio.site import WATCHED, build_site
from arm3dof.ui.studio.start import home
from arm3dof.ui.studio.studio import Studio
import nicegui.ui_run_with as starting

def running():
    return "arm3dof-studio" in [thread.name for thread in threading.enumerate()]

def get_objects():
    walks.append(running())
    return gc.get_objects()

walks, robot = [], load_robot()
starting.gc = SimpleNamespace(get_objects=get_objects)
with tempfile.TemporaryDirectory() as folder:
    eye = eye_spec("world", None)
    studio = Studio(Tuned(), robot, home(robot), eye, Path(folder), file_store())
    with LocalServer(build_site(studio), watched=WATCHED) as server:
        urlopen(server.url).read()
        walks.append(running())
    studio.close()
print(json.dumps(walks))
"""


def test_nothing_of_ours_runs_while_the_server_walks_over_all_objects() -> None:
    pytest.importorskip("mujoco")
    done = subprocess.run([sys.executable, "-c", WATCHED], capture_output=True, check=True)
    assert json.loads(done.stdout) == [False, True]
