"""What the studio writes down: always whole, and into one folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from arm3dof.errors import InputError
from arm3dof.files import write_atomically
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.frames import Frames
from arm3dof.runtime.recording import Recording

LONGEST = 120.0
"""How much of a run is kept [s]."""
# what a recording is made of, a sixteenth of a frame: the whole of a run fits into 2 MiB
_COLUMNS = ("t", "q", "v", "tau", "u", "q_target", "status", "source", "step_time", "control")


class Runs:
    """The frames of the last run, as they come."""

    def __init__(self) -> None:
        self._run = 0
        self._parts: list[Frames] = []

    def add(self, frames: Frames) -> None:
        """Take new frames, shape (n,), and keep those of the newest run."""
        run = int(frames["run"][-1])
        if run != self._run:
            self._run, self._parts = run, []
        mine = frames[(frames["run"] == run) & (frames["paused"] == 0)]
        if run > 0 and len(mine) and self._length() < LONGEST:
            self._parts.append(_columns(mine))

    @property
    def nbytes(self) -> int:
        """How much memory they take [bytes]."""
        return sum(part.nbytes for part in self._parts)

    def recording(self, robot: Robot, control: cmd.Control) -> Recording:
        """Return the last run.

        Args:
            robot: the arm as it is now.
            control: the controller as it is now.

        Raises:
            InputError: there has been no run, or one too short.
        """
        if sum(map(len, self._parts)) < 3:
            raise InputError("there is no run yet; press Run first")
        frames = np.concatenate(self._parts)
        frames = frames[np.append(True, np.diff(frames["t"]) > 0)]
        controlled = frames["control"] == 1
        controlled[0] = True  # a recording begins with a decision
        columns = {name: frames[name] for name in ("q", "v", "tau", "u")}
        return Recording(
            t=frames["t"] - frames["t"][0],
            **columns,
            e=frames["q_target"] - frames["q"],
            status=frames["status"].astype(np.int8),
            source=frames["source"].astype(np.int8),
            step_time=np.where(controlled, frames["step_time"], np.nan),
            control_dt=control.settings().dt,
            q_target=frames["q_target"][-1],
            joint_names=robot.joint_names,
            tool_frame=robot.tool_frame,
            limits=robot.limits,
            robot=robot.description,
            notes={"made by": "arm3dof studio", "controller": control.controller},
        )

    def _length(self) -> float:
        return float(self._parts[-1]["t"][-1] - self._parts[0]["t"][0]) if self._parts else 0.0


def _columns(frames: Frames) -> Frames:
    """Return what is kept of frames, shape (n,), in memory of its own."""
    kind = np.dtype([(name, frames.dtype[name]) for name in _COLUMNS])
    kept = np.empty(len(frames), kind)
    for name in _COLUMNS:
        kept[name] = frames[name]
    return kept


def write_into(folder: Path, name: str, data: bytes) -> Path:
    """Write a file into the studio's folder.

    Raises:
        InputError: the name leads out of the folder, or the file cannot be written.
    """
    path = folder / name
    if path.parent.resolve() != folder.resolve():
        raise InputError(f"'{name}' leads out of {folder}; give a plain name")
    write_atomically(path, data)
    return path


def free_name(folder: Path, stem: str, suffix: str) -> str:
    """Return the first of STEM-1, STEM-2, ... that no file has."""
    number = 1
    while (folder / f"{stem}-{number}{suffix}").exists():
        number += 1
    return f"{stem}-{number}{suffix}"
