"""A recording as what the page plays: poses of the links at a fixed rate, and its verdict."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import Metrics
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from arm3dof.ui.meshcat_window import Command
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.shapes import typed_array
from arm3dof.ui.things import thing_path

RATE = 60.0  # frames/s
MAX_FRAMES = 3600  # a longer run is shown at a lower rate
VERDICT, ACHIEVED = "verdict", "achieved"
"""Notes of a recording that say what came of it, where that is not a matter of settling."""


def frame_times(recording: Recording) -> tuple[Array, float]:
    """Return the times of the replay's frames, shape (k,) [s], and their rate [1/s]."""
    duration = float(recording.t[-1] - recording.t[0])
    rate = min(RATE, (MAX_FRAMES - 1) / duration) if duration > 0 else RATE
    count = int(np.floor(duration * rate + 1e-9)) + 1
    return recording.t[0] + np.arange(count) / rate, rate


def at_times(recording: Recording, column: Array, times: Array) -> Array:
    """Return a column interpolated at some times, shape (k, nv)."""
    return np.column_stack([np.interp(times, recording.t, values) for values in column.T])


def replay_command(recording: Recording, robot: Robot, drawing: RobotDrawing) -> Command:
    """Return the command that plays a recording.

    Args:
        recording: the run.
        robot: its robot.
        drawing: the nodes that move.
    """
    times, rate = frame_times(recording)
    q = at_times(recording, recording.q, times)
    rows = np.searchsorted(recording.t, times).clip(0, len(recording) - 1)
    openings = [None] * len(q) if recording.gripper is None else recording.gripper[rows].tolist()
    links = [drawing.placements(*it) for it in zip(q, openings, strict=True)]
    things = [poses[rows] for poses in recording.bodies.values()]
    poses = np.concatenate([np.array([_flat_poses(it) for it in links]), *things], axis=1)
    turns = np.array([is_turning(robot, joint) for joint in range(robot.nv)])
    position = np.where(turns, np.rad2deg(q), 1000 * q)
    return {
        "type": "replay",
        "frames": len(times),
        "fps": rate,
        "paths": [
            *(drawing.node(name) for name in drawing.link_names),
            *(thing_path(name) for name in recording.bodies),
        ],
        "poses": typed_array(poses.ravel()),
        "joints": [
            {
                "name": name,
                "unit": "°" if turns[joint] else "mm",
                "effort": "N m" if turns[joint] else "N",
                "limit": float(robot.limits.tau_max[joint]),
            }
            for joint, name in enumerate(robot.joint_names)
        ],
        "position": typed_array(position.ravel()),
        "torque": typed_array(at_times(recording, recording.tau, times).ravel()),
    }


def no_replay() -> Command:
    """Return the command that ends a replay."""
    return {"type": "replay", "frames": 0, "fps": RATE, "paths": [], "joints": []}


def caption_command(
    title: str, recording: Recording | None = None, metrics: Metrics | None = None
) -> Command:
    """Return the command that names the scene and gives a run's verdict.

    Args:
        title: name of the robot.
        recording: the run, if there is one.
        metrics: its figures of merit.
    """
    if recording is None or metrics is None:
        return {"type": "caption", "title": title, "verdict": "", "good": False, "facts": []}
    target = ", ".join(f"{angle:.1f}" for angle in np.rad2deg(recording.q_target))
    facts = [
        ("Target", f"{target} °"),
        ("Final error", f"{np.rad2deg(metrics.final_error):.3f} °"),
        ("Peak torque", f"{metrics.peak_torque:.2f} of {metrics.torque_limit:.2f} N m"),
        ("Energy", f"{metrics.energy:.2f} J"),
        ("Control step", f"{1e6 * metrics.step_time_p50:.0f} µs (median)"),
    ]
    return {
        "type": "caption",
        "title": title,
        "verdict": verdict(recording, metrics),
        "good": is_good(recording, metrics),
        "facts": facts,
    }


def verdict(recording: Recording, metrics: Metrics) -> str:
    """Say in a few words how a run ended."""
    if VERDICT in recording.notes:
        told = recording.notes[VERDICT]
        return told[:1].upper() + told[1:]
    if metrics.torque_violations:
        return f"Torque limit broken in {metrics.torque_violations} steps"
    if metrics.settling_time is not None:
        return f"Settled in {metrics.settling_time:.2f} s"
    return f"Not settled after {recording.t[-1] - recording.t[0]:.1f} s"


def is_good(recording: Recording, metrics: Metrics) -> bool:
    """Whether a run ended as it was meant to."""
    if ACHIEVED in recording.notes:
        return recording.notes[ACHIEVED] == "yes"
    return metrics.settled and metrics.torque_violations == 0


def is_turning(robot: Robot, joint: int) -> bool:
    """Whether a joint turns (rather than slides)."""
    return not robot.model.joints[joint + 1].shortname().startswith("JointModelP")


def sample_rows(column: Array, count: int) -> Array:
    """Return at most ``count`` rows spread evenly over a column, its ends included."""
    rows = np.linspace(0, len(column) - 1, min(count, len(column))).round().astype(int)
    sampled: Array = column[rows]
    return sampled


def _flat_poses(transforms: Array) -> Array:
    """Return (4, 4) poses as x, y, z and the quaternion x, y, z, w, one after the other."""
    return np.concatenate([pin.SE3ToXYZQUAT(pin.SE3(matrix)) for matrix in transforms])
