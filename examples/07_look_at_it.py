"""Save a run, and turn it into figures and into a page that plays it in 3-D."""

import tempfile
from pathlib import Path

import numpy as np

import arm3dof
from arm3dof.runtime.experiment import simulate
from arm3dof.ui.plots import save_figures
from arm3dof.ui.report import write_replay

robot = arm3dof.load_robot("arm3dof")
recording = simulate(robot, np.zeros(3), np.deg2rad([28.1, 67.8, 53.8]), duration=3.0)

folder = Path(tempfile.mkdtemp(prefix="arm3dof-"))
files = [recording.save(folder / "run.npz"), *save_figures(recording, folder)]
files.append(write_replay(recording, folder / "replay.html"))
for file in files:
    print(f"{file.stat().st_size / 1024:7.0f} KiB  {file}")

# A recording brings its robot along.
again = arm3dof.Recording.load(folder / "run.npz")
print(again.load_robot(), "settled:", arm3dof.summarise(again).settled)

# To play it on a live page instead: arm3dof view run.npz, or
#   from arm3dof.ui.meshcat_scene import recording_scene
#   from arm3dof.ui.server import serve
#   with serve(recording_scene(again).window) as server: print(server.url); server.wait()
