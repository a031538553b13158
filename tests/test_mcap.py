"""The log that is written is the run that was recorded, as mcap's own reader reads it."""

from __future__ import annotations

import base64
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader
from runs import carried_run, smooth_run

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.errors import InputError, MissingExtra
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui.mcap_log import write_mcap

PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(200))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def run(robot: Robot) -> Recording:
    made = smooth_run(robot, duration=1.0)
    status, source = np.array(made.status), np.array(made.source)
    status[100:200], source[100:200] = ControlStatus.NOT_SOLVED, TorqueSource.PREVIOUS_PLAN
    return replace(made, status=status, source=source, notes={"mpc.horizon": "20"})


@pytest.fixture(scope="module")
def path(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_mcap(run, tmp_path_factory.mktemp("log") / "run.mcap", PNG)


@pytest.fixture(scope="module")
def messages(path: Path) -> dict[str, list[tuple[int, dict]]]:
    """Times and contents by topic."""
    found: dict[str, list[tuple[int, dict]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert channel.message_encoding == "json"
            assert schema.encoding == "jsonschema"
            data = json.loads(message.data)
            assert_fits(json.loads(schema.data), data)
            found.setdefault(channel.topic, []).append((message.log_time, data))
    return found


def assert_fits(schema: dict, data: object) -> None:
    """Check that a message holds what its schema says, and all of it."""
    kinds = {"number": (int, float), "integer": int, "string": str, "boolean": bool}
    if schema.get("type") == "object":
        assert set(data) == set(schema["properties"]), schema["title"]
        for name, part in schema["properties"].items():
            assert_fits(part, data[name])
    elif schema.get("type") == "array":
        for item in data:
            assert_fits(schema["items"], item)
    elif "type" in schema:
        assert isinstance(data, kinds[schema["type"]])


def test_the_schemas_are_those_that_foxglove_knows(path: Path) -> None:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    names = {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}
    assert names == {
        "/scene": "foxglove.SceneUpdate",
        "/tf": "foxglove.FrameTransforms",
        "/camera/image": "foxglove.CompressedImage",
        "/status": "arm3dof.Status",
        **{
            f"/joints/{name}": "arm3dof.JointValues"
            for name in ("position", "velocity", "error", "input", "torque")
        },
    }


def test_every_row_of_every_column_is_there(
    run: Recording, messages: dict[str, list[tuple[int, dict]]]
) -> None:
    columns = {"position": run.q, "velocity": run.v, "error": run.e, "input": run.u}
    columns["torque"] = run.tau
    for name, column in columns.items():
        read = messages[f"/joints/{name}"]
        times = np.array([time for time, _ in read])
        np.testing.assert_array_equal(times, np.rint(1e9 * run.t).astype(np.int64))
        values = [[data[joint] for joint in run.joint_names] for _, data in read]
        np.testing.assert_array_equal(values, column)  # to the last bit
        stamps = [data["timestamp"]["sec"] * 10**9 + data["timestamp"]["nsec"] for _, data in read]
        np.testing.assert_array_equal(stamps, times)


def test_transforms_are_pinocchios(
    robot: Robot, run: Recording, messages: dict[str, list[tuple[int, dict]]]
) -> None:
    read = messages["/tf"]
    assert len(read) == 60
    for time, data in read:
        q = np.array([np.interp(time / 1e9, run.t, column) for column in run.q.T])
        for transform in data["transforms"]:
            assert transform["parent_frame_id"] == "world"
            turn = pin.Quaternion(*(transform["rotation"][k] for k in "wxyz"))
            found = pin.SE3(turn.matrix(), np.array([transform["translation"][k] for k in "xyz"]))
            expected = robot.placement(q, transform["child_frame_id"])
            np.testing.assert_allclose(found.homogeneous, expected.homogeneous, atol=2e-9)


def test_the_scene_is_fixed_to_the_links(
    robot: Robot, run: Recording, messages: dict[str, list[tuple[int, dict]]]
) -> None:
    ((time, scene),) = messages["/scene"]
    assert time == 0
    frames = {each["child_frame_id"] for each in messages["/tf"][0][1]["transforms"]} | {"world"}
    entities = {each["id"]: each for each in scene["entities"]}
    assert {each["frame_id"] for each in entities.values()} <= frames
    (ball,) = entities["target"]["spheres"]
    goal = robot.placement(run.q_target).translation
    np.testing.assert_allclose([ball["pose"]["position"][k] for k in "xyz"], goal, atol=1e-12)
    drawn = sum(len(e["cubes"]) + len(e["cylinders"]) for e in entities.values())
    assert drawn == run.robot.urdf.count("<visual")


def test_cylinders_stand_on_z_as_in_the_urdf(messages: dict[str, list[tuple[int, dict]]]) -> None:
    """The base plate is a flat cylinder, whose axis is the base frame's z."""
    ((_, scene),) = messages["/scene"]
    plates = [c for e in scene["entities"] for c in e["cylinders"] if c["size"]["x"] > 0.1]
    assert plates
    for plate in plates:
        turn = pin.Quaternion(*(plate["pose"]["orientation"][k] for k in "wxyz"))
        assert abs(turn.matrix()[2, 2]) == pytest.approx(1)
        assert plate["size"]["z"] < plate["size"]["x"]
        assert max(plate["top_scale"], plate["bottom_scale"]) == 1


def test_statuses_and_picture(run: Recording, messages: dict[str, list[tuple[int, dict]]]) -> None:
    read = messages["/status"]
    assert len(read) == run.control_rows.sum()
    levels = [data["level"] for _, data in read]
    assert levels == [0] * 4 + [2] * 4 + [0] * 12
    assert read[4][1]["status"] == "not_solved"
    assert "the plan of the last good step" in read[4][1]["sentence"]
    assert read[0][1]["step_time"] == 2e-4
    ((_, image),) = messages["/camera/image"]
    assert base64.b64decode(image["data"]) == PNG
    assert image["format"] == "png"


def test_settings_and_the_robot_come_along(run: Recording, path: Path) -> None:
    with path.open("rb") as file:
        reader = make_reader(file)
        attached = {each.name: each.data for each in reader.iter_attachments()}
        metadata = {each.name: each.metadata for each in reader.iter_metadata()}
    assert attached["robot.urdf"].decode() == run.robot.urdf
    assert json.loads(attached["summary.json"])["settled"] is not None
    assert metadata["notes"] == {"mpc.horizon": "20"}
    about = metadata["run"]
    assert float(about["control_dt"]) == run.control_dt
    assert [float(q) for q in about["q_target"].split(", ")] == run.q_target.tolist()
    assert float(about["joint2_tau_max"]) == run.limits.tau_max[1]


def test_the_same_run_is_the_same_file(run: Recording, path: Path, tmp_path: Path) -> None:
    assert write_mcap(run, tmp_path / "b.mcap", PNG).read_bytes() == path.read_bytes()
    assert path.stat().st_size < 500_000


def test_meshes_become_triangles(tmp_path: Path) -> None:
    robot = load_robot("so101")
    start = robot.limits.q_min / 2 + robot.limits.q_max / 2
    run = smooth_run(robot, start=start, target=start + 0.1, duration=0.2)
    with write_mcap(run, tmp_path / "run.mcap").open("rb") as file:
        topics = {channel.topic: m.data for _, channel, m in make_reader(file).iter_messages()}
    assert "/camera/image" not in topics
    for entity in json.loads(topics["/scene"])["entities"]:
        for part in entity["triangles"]:
            assert max(part["indices"]) < len(part["points"])
            assert len(part["indices"]) % 3 == 0


def test_gripper_and_objects_move(robot: Robot, tmp_path: Path) -> None:
    run = carried_run(robot)
    found: dict[str, list[tuple[float, dict]]] = {}
    with write_mcap(run, tmp_path / "run.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert_fits(json.loads(schema.data), data := json.loads(message.data))
            found.setdefault(channel.topic, []).append((message.log_time / 1e9, data))
    assert [data["opening"] for _, data in found["/gripper"]] == run.gripper.tolist()
    ((_, scene),) = found["/scene"]
    frames = {each["id"]: each["frame_id"] for each in scene["entities"]}
    assert frames["things/cylinder"] == "things/cylinder"
    assert frames["bins/green"] == "world"
    fingers = []
    for t, data in found["/tf"]:
        places = {each["child_frame_id"]: each["translation"] for each in data["transforms"]}
        row = int(np.searchsorted(run.t, t - 1e-9))
        assert places["things/cylinder"]["z"] == run.bodies["cylinder"][row, 2]
        ends = [[places[f"{side}_finger"][k] for k in "xyz"] for side in ("left", "right")]
        fingers.append(np.linalg.norm(np.subtract(*ends)))
    assert fingers[0] - fingers[-1] == pytest.approx(0.02, abs=1e-3)


def test_what_cannot_be_written_is_named(
    run: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"a\.mcap: cannot be written"):
        write_mcap(run, tmp_path / "file" / "a.mcap")
    with pytest.raises(InputError, match="no PNG, JPEG or WebP"):
        write_mcap(run, tmp_path / "a.mcap", b"GIF89a")
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(MissingExtra, match=r"arm3dof\[share\]"):
        write_mcap(run, tmp_path / "a.mcap")
    assert [each.name for each in tmp_path.iterdir()] == ["file"]
