"""Send a run to others: one page, a video, a log for Foxglove, the first and the last pose."""

import tempfile
from pathlib import Path

import numpy as np

import arm3dof
from arm3dof.runtime.experiment import simulate
from arm3dof.ui.mcap_log import write_mcap
from arm3dof.ui.report import write_report
from arm3dof.ui.run_frames import run_frames, save_stills
from arm3dof.ui.video import write_mp4

robot = arm3dof.load_robot("arm3dof")
recording = simulate(robot, np.zeros(3), np.deg2rad([28.1, 67.8, 53.8]), duration=1.0)
folder = Path(tempfile.mkdtemp(prefix="arm3dof-"))

files = [write_report(recording, folder / "report.html"), *save_stills(recording, folder)]
try:
    files.append(write_mcap(recording, folder / "run.mcap"))
    small = run_frames(recording, fps=12.5, size=(640, 360))  # drawn one by one, as they are taken
    files.append(write_mp4(folder / "run.mp4", small, fps=12.5))
except arm3dof.MissingExtra as advice:
    print(advice)

for file in files:
    print(f"{file.stat().st_size / 1024:7.0f} KiB  {file}")

# In a notebook, as the last line of a cell: arm3dof.show(recording)
print(arm3dof.show(recording))
