"""The loop, the recording and its figures of merit."""

from dataclasses import replace

import numpy as np
import pytest

from arm3dof.control.mpc import MpcController
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.errors import InputError, MissingFile
from arm3dof.model.library import load_robot
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.world import Bin, Body, World
from arm3dof.state import JointState

TARGET = np.array([0.3, 0.6, -0.4])


class Script:
    """A controller that plays torques, so that the loop can be checked by hand."""

    dt = 0.01

    def __init__(self):
        self.seen = []

    def reset(self):
        self.seen.clear()

    def step(self, state, q_target):
        self.seen.append(state)
        k = float(len(self.seen))
        tau = np.array([0.001 * k, 0.0, 0.0])
        plan = np.zeros((1, 6))
        return ControlStep(
            tau, 10 * tau, plan, ControlStatus.SOLVED, TorqueSource.OPTIMUM, 1e-4 * k
        )


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof", overrides={"link3.mass": 0.2, "gravity.z": -9.8})


@pytest.fixture(scope="module")
def recording(robot):
    plant = PinocchioPlant(robot)
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
    return run_loop(plant, MpcController(robot), TARGET, 2.0, notes={"title": "a run"})


def test_the_loop_holds_each_torque_and_records_every_plant_step(robot):
    plant, script, watched = PinocchioPlant(robot, dt=0.002), Script(), []
    plant.reset(JointState(1.0, np.zeros(3), np.zeros(3)))
    run = run_loop(plant, script, TARGET, 0.035, [lambda state, step: watched.append(step)])
    assert len(run) == 18
    assert len(script.seen) == len(watched) == 4
    np.testing.assert_allclose(run.t, 1.0 + 0.002 * np.arange(18))
    np.testing.assert_allclose(run.tau[:, 0], 0.001 * np.repeat([1, 2, 3, 4], [5, 5, 5, 3]))
    np.testing.assert_array_equal(run.control_rows, np.arange(18) % 5 == 0)
    np.testing.assert_allclose(run.step_time[run.control_rows], [1e-4, 2e-4, 3e-4, 4e-4])
    np.testing.assert_allclose(run.e, TARGET - run.q)
    again = PinocchioPlant(robot, dt=0.002)
    again.reset(JointState(1.0, np.zeros(3), np.zeros(3)))
    for row in range(18):
        np.testing.assert_array_equal(run.q[row], again.state.q)
        np.testing.assert_array_equal(run.v[row], again.state.v)
        again.step(run.tau[row])


def test_a_recording_survives_the_disk_bit_for_bit(recording, robot, tmp_path):
    path = recording.save(tmp_path / "deep" / "run.npz")
    back = Recording.load(path)
    for name in ("t", "q", "v", "tau", "u", "e", "status", "source", "step_time", "q_target"):
        np.testing.assert_array_equal(getattr(back, name), getattr(recording, name))
    assert back.joint_names == recording.joint_names
    assert back.notes == {"title": "a run"}
    assert summarise(back) == summarise(recording)
    rebuilt = back.load_robot()
    q = np.array([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(rebuilt.mass_matrix(q), robot.mass_matrix(q))
    np.testing.assert_array_equal(rebuilt.gravity(q), robot.gravity(q))
    assert [file.name for file in path.parent.iterdir()] == ["run.npz"]


def test_files_that_are_no_recording_are_refused_in_one_line(recording, tmp_path):
    with pytest.raises(MissingFile, match="no such recording"):
        Recording.load(tmp_path / "absent.npz")
    good = recording.save(tmp_path / "run.npz").read_bytes()
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    (tmp_path / "empty.npz").write_bytes(b"")
    (tmp_path / "text.npz").write_text("hello")
    (tmp_path / "cut.npz").write_bytes(good[: len(good) // 2])
    for name in ("other", "empty", "text", "cut"):
        with pytest.raises(InputError, match=r"not a recording of arm3dof") as caught:
            Recording.load(tmp_path / f"{name}.npz")
        assert "\n" not in str(caught.value)


def test_a_recording_cannot_be_written_to(recording):
    for name in ("q", "tau", "status", "step_time"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(recording, name)[0] = 0


def test_mistakes_in_the_call_are_named(robot):
    plant, script = PinocchioPlant(robot, dt=0.003), Script()
    with pytest.raises(InputError, match="not a whole number of plant steps"):
        run_loop(plant, script, TARGET, 1.0)
    plant = PinocchioPlant(robot)
    for duration in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="duration"):
            run_loop(plant, script, TARGET, duration)
    with pytest.raises(InputError, match="q_target has shape"):
        run_loop(plant, script, [0.0], 1.0)


def synthetic(robot, e, v, tau, dt=0.01):
    n = len(e)
    columns = {
        name: np.zeros((n, 3)) + np.asarray(column, float).reshape(n, -1)
        for name, column in {"e": e, "v": v, "tau": tau}.items()
    }
    return Recording(
        t=np.arange(n) * dt,
        q=-columns["e"],
        u=np.zeros((n, 3)),
        status=np.zeros(n),
        source=np.zeros(n),
        step_time=np.where(np.arange(n) % 5 == 0, 1e-4, np.nan),
        control_dt=5 * dt,
        q_target=np.zeros(3),
        joint_names=robot.joint_names,
        tool_frame="tool",
        limits=robot.limits,
        robot=robot.description,
        notes={},
        **columns,
    )


def test_settling_counts_from_the_last_time_that_any_joint_was_out(robot):
    e = np.full(100, np.deg2rad(2.0))
    e[30:] = np.deg2rad(0.4)
    metrics = summarise(synthetic(robot, e, np.zeros(100), np.zeros(100)))
    assert metrics.settled
    assert metrics.settling_time == pytest.approx(0.30)
    v = np.zeros(100)
    v[59] = 0.051
    assert summarise(synthetic(robot, e, v, np.zeros(100))).settling_time == pytest.approx(0.60)
    e[-1] = np.deg2rad(0.6)
    late = summarise(synthetic(robot, e, v, np.zeros(100)))
    assert (late.settled, late.settling_time) == (False, None)
    assert late.final_error == pytest.approx(np.deg2rad(0.6))


def test_energy_violations_and_saturation_are_counted_by_hand(robot):
    n, limit = 100, robot.limits.tau_max[0]
    tau, v = np.full(n, 0.5), np.full(n, 2.0)
    tau[:10] = limit
    tau[3] = limit + 0.01
    v[50:53] = 8.0
    metrics = summarise(synthetic(robot, np.zeros(n), v, tau))
    assert metrics.torque_violations == 1
    assert metrics.velocity_violations == 3
    assert metrics.peak_torque == pytest.approx(limit + 0.01)
    assert metrics.torque_limit == limit
    assert metrics.saturation == pytest.approx(2 / 20)
    assert metrics.energy == pytest.approx(3 * 0.01 * np.sum(tau * v))
    assert metrics.torque_squared == pytest.approx(3 * 0.01 * np.sum(tau**2))
    assert metrics.step_time_p50 == metrics.step_time_max == 1e-4
    assert metrics.status_counts == {"solved": 20}


# ---- what moves beside the arm -------------------------------------------------------------------


def test_a_recording_keeps_the_gripper_and_the_objects(tmp_path):
    robot = load_robot("arm3dof")
    plain = run_loop(PinocchioPlant(robot), MpcController(robot), np.zeros(3), 0.05)
    assert plain.gripper is None
    assert not plain.bodies
    rows = len(plain)
    poses = np.tile([0.2, 0.0, -0.09, 0.0, 0.0, 0.0, 1.0], (rows, 1))
    poses[:, 2] += np.linspace(0, 0.1, rows)
    body = Body("red_0", "bottle", 0.03, 0.05, 0.02, (0.8, 0.1, 0.1), 0.2, 0.0)
    world = World(bodies=(body,), bins=(Bin("red", 0.0, -0.2, (0.05, 0.06), (0.5, 0.5, 0.5)),))
    full = replace(
        plain, gripper=np.linspace(0.05, 0.02, rows), world=world, bodies={"red_0": poses}
    )
    again = Recording.load(full.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(again.gripper, full.gripper)
    np.testing.assert_array_equal(again.bodies["red_0"], poses)
    assert again.world == world
    bare = Recording.load(plain.save(tmp_path / "plain.npz"))
    assert (bare.gripper, bare.world, dict(bare.bodies)) == (None, None, {})


def test_poses_of_objects_must_fit_the_rows():
    robot = load_robot("arm3dof")
    plain = run_loop(PinocchioPlant(robot), MpcController(robot), np.zeros(3), 0.05)
    with pytest.raises(InputError, match="poses of body 'red'"):
        replace(plain, bodies={"red": np.zeros((3, 7))})
    with pytest.raises(InputError, match="gripper has shape"):
        replace(plain, gripper=np.zeros(2))
