"""What happened in a run: the columns from which every plot, page and log is drawn."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.errors import InputError, MissingFile
from arm3dof.files import write_atomically
from arm3dof.model.build import robot_from_description
from arm3dof.model.robot import Description, Limits, Robot
from arm3dof.sim.world import World
from arm3dof.state import Array, frozen_array

_FORMAT = 1
_COLUMNS = ("t", "q", "v", "tau", "u", "e", "status", "source", "step_time")


@dataclass(frozen=True, eq=False)
class Recording:
    """One row a plant step: the state at ``t`` and the torque that is held from then on.

    Attributes:
        t: time, shape (n,) [s].
        q: joint positions, shape (n, nv) [rad].
        v: joint velocities, shape (n, nv) [rad/s].
        tau: torque applied from ``t`` on, shape (n, nv) [N m].
        u: the controller's input, a joint acceleration, shape (n, nv) [rad/s^2].
        e: error q_target - q, shape (n, nv) [rad].
        status: ``ControlStatus`` of the control step in force, shape (n,).
        source: ``TorqueSource`` of the control step in force, shape (n,).
        step_time: wall time of the controller, shape (n,) [s]; NaN on rows where it did not run.
        control_dt: time between two control steps [s].
        q_target: target at the end of the run, shape (nv,) [rad].
        joint_names: names of the joints.
        tool_frame: the frame that was brought to the target.
        limits: the robot's limits.
        robot: the description from which the robot can be built again.
        notes: what else is worth keeping, as text by name.
        gripper: opening of the gripper, shape (n,) [m]; ``None`` where it did not move.
        world: what stood around the arm at the start; ``None`` for nothing.
        bodies: poses of the world's bodies by name in the base frame, each x, y, z and the
            quaternion x, y, z, w of its middle, shape (n, 7) [m].
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    u: Array
    e: Array
    status: NDArray[np.int8]
    source: NDArray[np.int8]
    step_time: Array
    control_dt: float
    q_target: Array
    joint_names: tuple[str, ...]
    tool_frame: str
    limits: Limits
    robot: Description
    notes: Mapping[str, str]
    gripper: Array | None = None
    world: World | None = None
    bodies: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t = frozen_array(self.t, None, name="t")
        nv = len(self.joint_names)
        object.__setattr__(self, "t", t)
        for name in ("q", "v", "tau", "u", "e"):
            column = frozen_array(getattr(self, name), t.size, nv, name=name)
            object.__setattr__(self, name, column)
        for name in ("status", "source"):
            codes = np.array(getattr(self, name), dtype=np.int8)
            codes.flags.writeable = False
            object.__setattr__(self, name, codes)
        object.__setattr__(
            self, "step_time", frozen_array(self.step_time, t.size, name="step_time")
        )
        object.__setattr__(self, "q_target", frozen_array(self.q_target, nv, name="q_target"))
        if self.gripper is not None:
            gripper = frozen_array(self.gripper, t.size, name="gripper")
            object.__setattr__(self, "gripper", gripper)
        poses = {
            name: frozen_array(rows, t.size, 7, name=f"poses of body '{name}'")
            for name, rows in self.bodies.items()
        }
        object.__setattr__(self, "bodies", MappingProxyType(poses))

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def control_rows(self) -> NDArray[np.bool_]:
        """Mask of the rows in which the controller ran, shape (n,)."""
        return np.isfinite(self.step_time)

    def load_robot(self) -> Robot:
        """Build the robot of this run again."""
        return robot_from_description(self.robot, tool_frame=self.tool_frame)

    def save(self, path: str | Path) -> Path:
        """Write the recording as a compressed ``.npz``, whole or not at all, and return its path.

        Raises:
            InputError: the folder cannot be written.
        """
        path = Path(path)
        header = {
            "format": _FORMAT,
            "control_dt": self.control_dt,
            "joint_names": list(self.joint_names),
            "tool_frame": self.tool_frame,
            "robot": self.robot.to_dict(),
            "notes": dict(self.notes),
            "world": None if self.world is None else self.world.to_dict(),
            "bodies": list(self.bodies),
        }
        arrays = {name: getattr(self, name) for name in _COLUMNS}
        arrays["q_target"] = self.q_target
        for name in ("q_min", "q_max", "v_max", "tau_max"):
            arrays[name] = getattr(self.limits, name)
        if self.gripper is not None:
            arrays["gripper"] = self.gripper
        arrays |= {f"body_{index}": rows for index, rows in enumerate(self.bodies.values())}
        buffer = io.BytesIO()
        np.savez_compressed(buffer, header=np.array(json.dumps(header)), **arrays)
        write_atomically(path, buffer.getvalue())
        return path

    @staticmethod
    def load(path: str | Path) -> Recording:
        """Read a recording.

        Raises:
            MissingFile: there is no such file.
            InputError: the file is no recording, or is damaged.
        """
        path = Path(path)
        if not path.is_file():
            raise MissingFile(f"{path}: no such recording; 'arm3dof simulate --out DIR' writes one")
        try:
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                header = json.loads(str(file["header"]))
                if header["format"] != _FORMAT:
                    raise InputError(
                        f"{path}: format {header['format']} is not known; "
                        f"this version reads format {_FORMAT}"
                    )
                columns = {name: file[name] for name in (*_COLUMNS, "q_target")}
                bodies = {
                    name: file[f"body_{index}"]
                    for index, name in enumerate(header.get("bodies", ()))
                }
                limits = Limits(*(file[name] for name in ("q_min", "q_max", "v_max", "tau_max")))
                return Recording(
                    **columns,
                    control_dt=float(header["control_dt"]),
                    joint_names=tuple(header["joint_names"]),
                    tool_frame=header["tool_frame"],
                    limits=limits,
                    robot=Description.from_dict(header["robot"]),
                    notes=header["notes"],
                    gripper=file.get("gripper"),
                    world=_world(header.get("world")),
                    bodies=bodies,
                )
        except (zipfile.BadZipFile, OSError, EOFError, KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{path}: not a recording of arm3dof ({error}); give a run.npz"
            ) from None


def _world(values: Mapping[str, Any] | None) -> World | None:
    return None if values is None else World.from_dict(values)


def status_counts(recording: Recording) -> dict[str, int]:
    """Return how often each status and source occurred, by lower-case name."""
    rows = recording.control_rows
    counts: dict[str, int] = {}
    for status, source in zip(recording.status[rows], recording.source[rows], strict=True):
        name = ControlStatus(status).name.lower()
        if source != TorqueSource.OPTIMUM:
            name += f"/{TorqueSource(source).name.lower()}"
        counts[name] = counts.get(name, 0) + 1
    return counts
