"""A run as an MCAP log that Foxglove opens: the scene, transforms, joints, statuses, the picture.

Messages are JSON, in channels that docs/formats.md lists. Times are those of the recording, so
that a log begins at 0 s.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

import arm3dof
from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.errors import MissingExtra
from arm3dof.files import draft_of
from arm3dof.model.robot import Robot
from arm3dof.runtime.metrics import Metrics, summarise
from arm3dof.runtime.recording import Recording
from arm3dof.state import Array
from arm3dof.ui import mcap_schemas as schemas
from arm3dof.ui.mcap_scene import (
    path_entity,
    robot_entities,
    target_entity,
    thing_frame,
    world_entities,
)
from arm3dof.ui.meshcat_scene import PATH_END, TARGET
from arm3dof.ui.pictures import picture_kind
from arm3dof.ui.replay import at_times, frame_times, is_turning, sample_rows, verdict
from arm3dof.ui.report_data import status_level, status_sentence
from arm3dof.ui.robot_drawing import RobotDrawing
from arm3dof.ui.summary import run_report, to_json

WORLD = "world"
"""The frame that every link's pose is given in: the robot's base frame."""


class _Channel(NamedTuple):
    topic: str
    schema: schemas.Schema


class _Message(NamedTuple):
    channel: _Channel
    t: float
    data: Mapping[str, object]


def write_mcap(recording: Recording, path: str | Path, picture: bytes | None = None) -> Path:
    """Write a run as an MCAP log, whole or not at all.

    Args:
        recording: the run.
        path: the file to write; its folder is made when missing.
        picture: a PNG, JPEG or WebP file, for example what the camera saw.

    Returns:
        The path.

    Raises:
        MissingExtra: the package ``mcap`` is not installed.
        InputError: the folder cannot be written, or the picture is of another kind.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise MissingExtra("writing an MCAP log", "share") from None
    path = Path(path)
    robot, metrics = recording.load_robot(), summarise(recording)
    messages = list(_messages(recording, robot, picture))
    messages.sort(key=lambda message: message.t)  # stable: a channel keeps its order
    with draft_of(path) as draft, draft.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=f"arm3dof {arm3dof.__version__}")
        _write_messages(writer, messages)
        writer.add_attachment(0, 0, "robot.urdf", "application/xml", recording.robot.urdf.encode())
        summary = to_json(run_report(metrics)).encode()
        writer.add_attachment(0, 0, "summary.json", "application/json", summary)
        writer.add_metadata("run", _about(recording, robot, metrics))
        writer.add_metadata("notes", dict(recording.notes))
        writer.finish()
    return path


def _write_messages(writer: Any, messages: Sequence[_Message]) -> None:
    ids: dict[str, int] = {}
    counts: dict[str, int] = {}
    for (topic, schema), t, data in messages:
        if topic not in ids:
            text = json.dumps(schema).encode()
            known = writer.register_schema(str(schema["title"]), "jsonschema", text)
            ids[topic] = writer.register_channel(topic, "json", known)
        counts[topic] = counts.get(topic, -1) + 1
        stamp = _nanoseconds(t)
        body = json.dumps(data, separators=(",", ":"), allow_nan=False).encode()
        writer.add_message(ids[topic], stamp, body, stamp, counts[topic])


def _messages(r: Recording, robot: Robot, picture: bytes | None) -> Iterator[_Message]:
    drawing = RobotDrawing(robot)
    start = float(r.t[0])
    scene = _Channel("/scene", schemas.SCENE_UPDATE)
    yield _Message(scene, start, {"entities": _entities(r, robot, drawing)})
    if picture is not None:
        image = {
            "timestamp": _stamp(start),
            "frame_id": "camera",
            "data": base64.b64encode(picture).decode(),
            "format": picture_kind(picture),
        }
        yield _Message(_Channel("/camera/image", schemas.COMPRESSED_IMAGE), start, image)
    yield from _transforms(r, drawing)
    yield from _joints(r, robot)
    yield from _gripper(r)
    yield from _statuses(r)


def _entities(r: Recording, robot: Robot, drawing: RobotDrawing) -> list[dict[str, Any]]:
    path = np.array([robot.placement(q).translation for q in sample_rows(r.q, 400)])
    _, radius = drawing.enclosing_ball(sample_rows(r.q, 40))
    goal = robot.placement(r.q_target).translation
    around = [] if r.world is None else world_entities(r.world, WORLD)
    return [
        *robot_entities(drawing.visuals),
        *around,
        target_entity(WORLD, goal, 0.03 * radius, TARGET),
        path_entity(WORLD, path, PATH_END),
    ]


def _transforms(r: Recording, drawing: RobotDrawing) -> Iterator[_Message]:
    """Return the pose of every link and object, at the rate of the replay."""
    channel = _Channel("/tf", schemas.FRAME_TRANSFORMS)
    times, _ = frame_times(r)
    rows = np.searchsorted(r.t, times).clip(0, len(r) - 1)
    for t, row, q in zip(times, rows, at_times(r, r.q, times), strict=True):
        opening = None if r.gripper is None else float(r.gripper[row])
        links = zip(drawing.link_names, drawing.placements(q, opening), strict=True)
        transforms = [
            _transform(float(t), link, pin.SE3ToXYZQUAT(pin.SE3(place)))
            for link, place in links
            if link != WORLD
        ]
        transforms += [
            _transform(float(t), thing_frame(name), poses[row]) for name, poses in r.bodies.items()
        ]
        yield _Message(channel, float(t), {"transforms": transforms})


def _transform(t: float, link: str, place: Array) -> dict[str, object]:
    x, y, z, *turn = place
    return {
        "timestamp": _stamp(t),
        "parent_frame_id": WORLD,
        "child_frame_id": link,
        "translation": schemas.vector((x, y, z)),
        "rotation": schemas.quaternion(turn),
    }


def _joints(r: Recording, robot: Robot) -> Iterator[_Message]:
    """Return every row of the recording, one channel a quantity."""
    turns = [is_turning(robot, joint) for joint in range(robot.nv)]
    for topic, (what, values, turning, sliding) in {
        "/joints/position": ("position", r.q, "rad", "m"),
        "/joints/velocity": ("velocity", r.v, "rad/s", "m/s"),
        "/joints/error": ("error, target minus position", r.e, "rad", "m"),
        "/joints/input": ("the controller's input", r.u, "rad/s^2", "m/s^2"),
        "/joints/torque": ("torque of the motor", r.tau, "N m", "N"),
    }.items():
        units = {
            name: turning if turns[joint] else sliding for joint, name in enumerate(r.joint_names)
        }
        channel = _Channel(topic, schemas.joint_values(what, units))
        for t, row in zip(r.t.tolist(), values.tolist(), strict=True):
            finite = (value if np.isfinite(value) else None for value in row)
            named = dict(zip(r.joint_names, finite, strict=True))
            yield _Message(channel, t, {"timestamp": _stamp(t), **named})


def _gripper(r: Recording) -> Iterator[_Message]:
    """Return the gripper's opening in every row, where it moved."""
    if r.gripper is None:
        return
    channel = _Channel("/gripper", schemas.GRIPPER)
    for t, opening in zip(r.t.tolist(), r.gripper.tolist(), strict=True):
        yield _Message(channel, t, {"timestamp": _stamp(t), "opening": opening})


def _statuses(r: Recording) -> Iterator[_Message]:
    """Return what the controller said at each of its steps."""
    channel = _Channel("/status", schemas.STATUS)
    for row in np.flatnonzero(r.control_rows):
        status, source = ControlStatus(r.status[row]), TorqueSource(r.source[row])
        t = float(r.t[row])
        data = {
            "timestamp": _stamp(t),
            "status": status.name.lower(),
            "source": source.name.lower(),
            "sentence": status_sentence(status, source),
            "level": status_level(status, source),
            "step_time": float(r.step_time[row]),
        }
        yield _Message(channel, t, data)


def _about(r: Recording, robot: Robot, metrics: Metrics) -> dict[str, str]:
    limits = {
        f"{name}_{key}": f"{getattr(r.limits, key)[joint]:.17g}"
        for joint, name in enumerate(r.joint_names)
        for key in ("q_min", "q_max", "v_max", "tau_max")
    }
    return {
        "robot": robot.name,
        "source": r.robot.source,
        "joints": ", ".join(r.joint_names),
        "tool_frame": r.tool_frame,
        "control_dt": f"{r.control_dt:.17g}",
        "q_target": ", ".join(f"{q:.17g}" for q in r.q_target),
        "verdict": verdict(r, metrics),
        **limits,
    }


def _nanoseconds(t: float) -> int:
    return round(1e9 * t)


def _stamp(t: float) -> dict[str, int]:
    seconds, nanoseconds = divmod(_nanoseconds(t), 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}
