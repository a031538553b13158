"""Disturbances: each does to the arm what mechanics says, when it should, and leaves no trace."""

import json

import numpy as np
import pinocchio as pin
import pytest

from arm3dof.cli import app
from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.errors import FrameNotFound, InputError
from arm3dof.model.library import load_robot
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.sim.disturbance import DisturbedPlant, JointTorque, PayloadChange, Push, Wrench
from arm3dof.sim.encoder import EncoderNoise
from arm3dof.sim.events import share_of_step
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

FREE = {f"joint{i}.damping": 0.0 for i in (1, 2, 3)}
WEIGHTLESS = {"gravity.z": 0.0}
DT = 0.001


@pytest.fixture(scope="module")
def arm():
    return load_robot("arm3dof")


@pytest.fixture(scope="module")
def free_arm():
    return load_robot("arm3dof", overrides=FREE)


@pytest.fixture(scope="module")
def weightless():
    return load_robot("arm3dof", overrides=WEIGHTLESS)


def at(q, v=(0.0, 0.0, 0.0), t=0.0):
    return JointState(t, np.array(q, float), np.array(v, float))


START = at([0.1, 0.4, -0.6])


def disturbed(robot, *, start=START, dt=DT, **what):
    plant = DisturbedPlant(PinocchioPlant(robot, dt), **what)
    plant.reset(start)
    return plant


def follow(plant, torques):
    """Return the states before each torque and after the last, shape (n + 1, 2 nv)."""
    rows = [np.r_[plant.state.q, plant.state.v]]
    for tau in torques:
        state = plant.step(tau)
        rows.append(np.r_[state.q, state.v])
    return np.array(rows)


def script(count, seed=1, size=0.1):
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)), axis=0) * size / 10


def random_states(robot, count, seed=2):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield robot.random_configuration(rng), *rng.normal(size=(2, robot.nv)), rng.normal(size=6)


def external_forces(robot, q, wrench):
    """Return a wrench on the tool as Pinocchio takes it: one force a joint, in its own frame."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    frame = robot.model.getFrameId(robot.tool_frame, pin.FrameType.BODY)
    joint = robot.model.frames[frame].parentJoint
    turned = pin.SE3(data.oMf[frame].rotation.T, np.zeros(3))
    forces = [pin.Force.Zero() for _ in range(robot.model.njoints)]
    forces[joint] = robot.model.frames[frame].placement.act(turned.act(pin.Force(wrench)))
    return forces


# ---- wrenches ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm3dof", "ur5"])
def test_a_wrench_is_what_pinocchios_inverse_dynamics_takes_for_one(name):
    robot = load_robot(name)
    for q, v, a, wrench in random_states(robot, 20):
        data, forces = robot.model.createData(), external_forces(robot, q, wrench)
        tau = pin.rnea(robot.model, data, q, v, a, forces) + robot.friction_torque(v)
        direct = robot.inverse_dynamics(q, v, a) - robot.jacobian(q).T @ wrench
        np.testing.assert_allclose(tau, direct, atol=1e-9)
        step = 1e-6
        plant = PinocchioPlant(robot, step)
        plant.reset(JointState(0.0, q, v))
        if not robot.friction.any():
            gained = (plant.step(tau, tool_wrench=wrench).v - v) / step
            np.testing.assert_allclose(gained, a, atol=1e-3 * (1 + np.abs(a).max()))


def test_the_torque_that_inverse_dynamics_gives_holds_the_arm_against_a_wrench(arm):
    for q, _, _, wrench in random_states(arm, 3):
        zero = np.zeros(3)
        tau = pin.rnea(
            arm.model, arm.model.createData(), q, zero, zero, external_forces(arm, q, wrench)
        )
        pull = Wrench(0.0, wrench[:3], wrench[3:], duration=1.0)
        held = follow(disturbed(arm, start=at(q), wrenches=[pull]), [tau] * 300)
        np.testing.assert_allclose(held[-1], np.r_[q, zero], atol=1e-9)


def test_a_force_does_the_work_that_its_path_says(free_arm):
    force = np.array([0.4, -0.3, 0.6])
    plant = disturbed(free_arm, dt=0.0005, wrenches=[Wrench(0.0, force, duration=1.0)])
    energy, tool = plant.plant.energy(), free_arm.placement(plant.state.q).translation
    for _ in range(600):
        state = plant.step(np.zeros(3))
        work = force @ (free_arm.placement(state.q).translation - tool)
        assert plant.plant.energy() - energy == pytest.approx(work, abs=1e-7)
    assert abs(work) > 0.05


def test_a_moment_on_the_tool_does_the_work_that_its_turning_says(free_arm):
    moment = np.array([0.02, 0.05, -0.03])
    pull = Wrench(0.0, np.zeros(3), moment, duration=1.0)
    plant = disturbed(free_arm, dt=0.0005, wrenches=[pull])
    energy, power = plant.plant.energy(), []
    for _ in range(601):
        state = plant.state
        power.append(moment @ (free_arm.jacobian(state.q)[3:] @ state.v))
        gained = plant.plant.energy() - energy
        plant.step(np.zeros(3))
    assert gained == pytest.approx(np.trapezoid(power, dx=0.0005), abs=1e-6)
    assert abs(gained) > 0.01


def test_a_moment_on_a_joint_does_torque_times_angle(free_arm):
    plant = disturbed(free_arm, dt=0.0005, wrenches=[JointTorque(0.0, "joint3", 0.05, 1.0)])
    energy, start = plant.plant.energy(), plant.state.q
    for _ in range(300):
        state = plant.step(np.zeros(3))
    work = 0.05 * (state.q - start)[2]
    assert plant.plant.energy() - energy == pytest.approx(work, abs=1e-7)


def test_a_held_arm_gives_way_as_its_stiffness_says(arm):
    stiffness, pull = np.array([2.0, 3.0, 1.5]), np.array([0.3, -0.4, -0.8, 0.0, 0.02, 0.01])
    home = np.array([0.1, 0.4, -0.6])
    plant = disturbed(arm, start=at(home), wrenches=[Wrench(0.0, pull[:3], pull[3:], duration=9)])
    for _ in range(4000):
        state = plant.state
        plant.step(arm.gravity(state.q) + stiffness * (home - state.q) - 0.15 * state.v)
    np.testing.assert_allclose(
        stiffness * (state.q - home), arm.jacobian(state.q).T @ pull, atol=1e-6
    )
    assert np.abs(state.q - home).min() > 0.01


def test_a_weight_that_hangs_from_the_tool_is_held_like_a_payload(arm):
    q, weight = np.array([0.3, 0.5, 0.2]), np.array([0.0, 0.0, -0.1 * 9.81])
    tau = arm.with_payload(0.1).gravity(q)
    plant = disturbed(arm, start=at(q), wrenches=[Wrench(0.0, weight, duration=1.0)])
    np.testing.assert_allclose(follow(plant, [tau] * 300)[-1], np.r_[q, 0, 0, 0], atol=1e-9)


def test_wrenches_add_up(arm):
    force, moment = np.array([0.5, 0.1, -0.4]), np.array([0.01, 0.02, 0.03])
    one = [Wrench(0.01, force, moment, duration=0.05)]
    halves = [
        Wrench(0.01, force / 2, moment, duration=0.05),
        Wrench(0.01, force / 2, duration=0.05),
    ]
    torques = script(100)
    path = follow(disturbed(arm, wrenches=one), torques)
    np.testing.assert_array_equal(path, follow(disturbed(arm, wrenches=halves), torques))


def test_an_event_lasts_as_long_as_it_says_whatever_the_steps():
    rng = np.random.default_rng(0)
    for _ in range(200):
        event = JointTorque(rng.uniform(0, 0.5), 0, 1.0, rng.uniform(1e-4, 0.4))
        dt = rng.uniform(5e-4, 0.02)
        shares = np.array([share_of_step(event, k * dt, dt) for k in range(int(1 / dt) + 1)])
        assert shares.min() >= 0.0
        assert shares.max() <= 1.0
        assert shares.sum() * dt == pytest.approx(event.duration, rel=1e-6)


def test_before_and_after_an_event_the_plant_is_an_undisturbed_one(arm):
    torques = script(100)
    plant = disturbed(arm, wrenches=[Wrench(0.02, np.ones(3), duration=0.03)])
    path = follow(plant, torques)
    plain = PinocchioPlant(arm)
    plain.reset(START)
    np.testing.assert_array_equal(path[:21], follow(plain, torques[:20]))
    assert np.abs(path[21] - follow(plain, torques[20:21])[-1]).max() > 1e-6
    plain.reset(at(path[50, :3], path[50, 3:]))
    np.testing.assert_array_equal(path[50:], follow(plain, torques[50:]))


# ---- pushes ------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", ["joint2", 1])
def test_a_push_displaces_its_joint_at_its_time_and_nothing_else(arm, joint):
    torques = script(60)
    path = follow(disturbed(arm, pushes=[Push(0.03, joint, 0.2)]), torques)
    plain = PinocchioPlant(arm)
    plain.reset(START)
    calm = follow(plain, torques[:30])
    np.testing.assert_array_equal(path[:30], calm[:30])
    np.testing.assert_array_equal(path[30] - calm[30], [0, path[30, 1] - calm[30, 1], 0, 0, 0, 0])
    assert path[30, 1] - calm[30, 1] == pytest.approx(0.2, abs=1e-15)
    plain.reset(at(path[30, :3], path[30, 3:]))
    np.testing.assert_array_equal(path[30:], follow(plain, torques[30:]))


def test_pushes_at_the_start_at_once_and_in_the_past(arm):
    pushes = [Push(2.0, 0, 0.1), Push(2.0, 0, 0.2), Push(2.0, 2, -0.3), Push(1.9, 1, 9.0)]
    plant = disturbed(arm, start=at([0, 0, 0], t=2.0), pushes=pushes)
    np.testing.assert_allclose(plant.state.q, [0.3, 0.0, -0.3])
    again = plant.reset(at([0, 0, 0], t=2.0))
    np.testing.assert_array_equal(again.q, plant.state.q)
    np.testing.assert_array_equal(plant.reset(at([0, 0, 0], t=2.1)).q, 0.0)


def test_the_recording_shows_the_push_in_the_row_of_its_time(arm):
    plant = disturbed(arm, start=at([0, 0, 0]), pushes=[Push(0.2, "joint3", np.deg2rad(10))])
    run = run_loop(plant, MpcController(arm), np.zeros(3), 0.3)
    jumps = np.abs(np.diff(run.q[:, 2]))
    assert run.t[1 + np.argmax(jumps)] == pytest.approx(0.2)
    assert jumps.max() == pytest.approx(np.deg2rad(10), rel=1e-3)
    np.testing.assert_allclose(np.diff(run.t), DT, rtol=1e-9)


# ---- payloads ----------------------------------------------------------------------------------


def test_a_payload_comes_and_goes_and_leaves_no_trace(arm):
    changes = [PayloadChange(0.04, None), PayloadChange(0.02, 0.3, (0.0, 0.01, 0.0))]
    torques = script(80)
    plant = disturbed(arm, payloads=changes)
    path = follow(plant, torques)
    assert plant.robot.payload is None
    for robot, first, last in (
        (arm, 0, 20),
        (arm.with_payload(0.3, (0.0, 0.01, 0.0)), 20, 40),
        (arm, 40, 80),
    ):
        plain = PinocchioPlant(robot)
        plain.reset(at(path[first, :3], path[first, 3:]))
        np.testing.assert_array_equal(path[first : last + 1], follow(plain, torques[first:last]))


def test_a_payload_taken_up_before_the_start_is_carried_and_a_reset_begins_anew(arm):
    plant = disturbed(arm, payloads=[PayloadChange(-1.0, 0.1), PayloadChange(0.005, 0.2)])
    assert plant.robot.payload.mass == 0.1
    follow(plant, np.zeros((10, 3)))
    assert plant.robot.payload.mass == 0.2
    plant.reset(at([0, 0, 0]))
    assert plant.robot.payload.mass == 0.1
    plant.reset(at([0, 0, 0], t=-2.0))
    assert plant.robot.payload is None


def test_an_unknown_payload_makes_the_arm_sag_and_a_known_one_does_not(arm):
    target = np.array([0.2, 0.5, 0.3])
    loaded = arm.with_payload(0.02)
    errors = []
    for known in (arm, loaded):
        plant = PinocchioPlant(loaded)
        plant.reset(at(target))
        blind = MpcController(known, MpcSettings(observer_gain=0))
        run = run_loop(plant, blind, target, 1.0)
        errors.append(summarise(run).final_error)
    assert errors[0] > np.deg2rad(1.0)
    assert errors[1] < np.deg2rad(0.01)


def test_a_plant_goes_on_only_with_a_robot_of_as_many_joints(arm):
    with pytest.raises(InputError, match="has 6 joints; this plant goes on with 3"):
        PinocchioPlant(arm).change_robot(load_robot("ur5"))


# ---- delay -------------------------------------------------------------------------------------


def test_a_delay_shifts_the_response_exactly(weightless):
    torques, late = script(200), 37
    prompt = follow(disturbed(weightless), torques)
    delayed = follow(disturbed(weightless, delay=late * DT), torques)
    np.testing.assert_array_equal(delayed[: late + 1], np.tile(prompt[0], (late + 1, 1)))
    np.testing.assert_array_equal(delayed[late:], prompt[: len(prompt) - late])


@pytest.mark.parametrize(("delay", "steps"), [(0.0, 0), (0.0004, 0), (0.0016, 2), (0.05, 50)])
def test_commands_act_after_the_delay_and_gravity_is_held_until_then(arm, delay, steps):
    plant, torques = disturbed(arm, delay=delay), script(120)
    np.testing.assert_array_equal(plant.applied_torque, np.zeros(3))
    applied = []
    for tau in torques:
        plant.step(tau)
        applied.append(plant.applied_torque)
    holding = np.tile(arm.gravity(START.q), (steps, 1))
    np.testing.assert_array_equal(applied, np.vstack([holding, torques])[:120])


def test_the_arm_is_held_within_the_limits_of_its_motors_with_what_it_carries(arm):
    load, q = [PayloadChange(0.0, 3.0)], np.zeros(3)
    plant = disturbed(arm, start=at(q), delay=0.01, payloads=load)
    plant.step(np.zeros(3))
    limit = arm.limits.tau_max
    wanted = arm.with_payload(3.0).gravity(q)
    assert (np.abs(wanted) > limit).any()
    np.testing.assert_allclose(plant.applied_torque, np.clip(wanted, -limit, limit))


def test_an_endless_delay_takes_no_memory(arm):
    plant = disturbed(arm, delay=1e12)
    plant.step(np.ones(3))
    np.testing.assert_array_equal(plant.applied_torque, arm.gravity(START.q))


def test_a_reset_forgets_commands_under_way(arm):
    plant = disturbed(arm, delay=0.005)
    follow(plant, np.ones((5, 3)))
    plant.reset(at([0, 0, 0]))
    plant.step(np.zeros(3))
    np.testing.assert_array_equal(plant.applied_torque, arm.gravity([0, 0, 0]))


# ---- noise -------------------------------------------------------------------------------------


def readings(robot, count, noise, *, seed=0, **what):
    plant = disturbed(robot, noise=noise, rng=np.random.default_rng(seed), **what)
    hold = robot.gravity(plant.state.q)
    rows = []
    for _ in range(count):
        seen, true = plant.measure(), plant.state
        rows.append(np.r_[seen.q - true.q, seen.v - true.v])
        plant.step(hold)
    return np.array(rows)


@pytest.mark.parametrize("time_constant", [0.0002, 0.002, 0.01, 0.05])
def test_noise_has_the_statistics_that_the_docstring_states(time_constant):
    sigma, dt = np.full(40_000, 0.002), 0.001
    noise = EncoderNoise(sigma, dt, time_constant, np.random.default_rng(1))
    a = np.exp(-dt / time_constant)
    spread = sigma[0] * (1 - a) / dt * np.sqrt(2 * (1 - a) / (1 + a) ** 3)
    if time_constant > 5 * dt:
        assert spread == pytest.approx(
            sigma[0] * np.sqrt(dt / time_constant) / (2 * time_constant), rel=0.02
        )
    before = noise.q
    for _ in range(5):  # lasting from the first reading on
        assert np.std(noise.q) == pytest.approx(sigma[0], rel=0.02)
        assert np.std(noise.v) == pytest.approx(spread, rel=0.02)
        assert abs(np.mean(noise.v)) < 4 * spread / 200
        noise.advance()
        assert abs(np.corrcoef(before, noise.q)[0, 1]) < 0.02
        before = noise.q


def test_the_velocitys_noise_is_the_smoothed_derivative_of_the_positions(arm):
    q, v = np.split(readings(arm, 300, 0.002, velocity_filter=0.005), 2, axis=1)
    a = np.exp(-DT / 0.005)
    drive = (1 - a) ** 2 / DT * np.diff(q, axis=0)
    np.testing.assert_allclose(v[2:], 2 * a * v[1:-1] - a**2 * v[:-2] + drive[1:], atol=1e-9)


def test_each_joint_has_its_own_noise(arm):
    rows = readings(arm, 2000, [0.001, 0.0, 0.003])
    np.testing.assert_allclose(rows.std(axis=0)[:3], [0.001, 0.0, 0.003], rtol=0.1)
    np.testing.assert_array_equal(rows[:, [1, 4]], 0.0)
    assert abs(np.corrcoef(rows[:, 0], rows[:, 2])[0, 1]) < 0.1


def test_noise_is_in_what_is_measured_and_not_in_what_is(arm):
    torques = script(50)
    noisy = disturbed(arm, noise=0.01, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(follow(noisy, torques), follow(disturbed(arm), torques))
    first, second = noisy.measure(), noisy.measure()
    np.testing.assert_array_equal(np.r_[first.q, first.v], np.r_[second.q, second.v])
    assert first.t == noisy.state.t
    assert np.abs(first.q - noisy.state.q).min() > 0


def test_without_noise_the_truth_is_measured(arm):
    plain = PinocchioPlant(arm)
    for plant in (plain, disturbed(arm), disturbed(arm, noise=[0, 0, 0])):
        seen, true = plant.measure(), plant.state
        np.testing.assert_array_equal(np.r_[seen.q, seen.v], np.r_[true.q, true.v])


def test_the_same_seed_gives_the_same_run(arm):
    def run(seed):
        plant = disturbed(
            arm,
            start=at([0, 0, 0]),
            payloads=[PayloadChange(0.1, 0.02)],
            pushes=[Push(0.15, "joint1", 0.1)],
            wrenches=[Wrench(0.2, np.array([0, 0, -1.0]), duration=0.05)],
            delay=0.01,
            noise=0.001,
            rng=np.random.default_rng(seed),
        )
        return run_loop(plant, MpcController(arm), np.full(3, 0.3), 0.4)

    first, second, other = run(1), run(1), run(2)
    for column in ("q", "v", "tau", "u"):
        np.testing.assert_array_equal(getattr(first, column), getattr(second, column))
    assert np.abs(first.q - other.q).max() > 0


# ---- in the loop -------------------------------------------------------------------------------


class Extremes:
    """A controller that commands one torque limit and then the other, and keeps what it saw."""

    dt = 0.01

    def __init__(self, robot):
        self.robot, self.seen = robot, []

    def reset(self):
        self.seen.clear()

    def step(self, state, q_target):
        self.seen.append(state)
        tau = self.robot.limits.tau_max * (-1.0) ** len(self.seen)
        return ControlStep(
            tau, tau, np.zeros((1, 6)), ControlStatus.SOLVED, TorqueSource.OPTIMUM, 1e-4
        )


def test_the_controller_sees_measurements_and_the_recording_holds_the_truth(arm):
    plant = disturbed(arm, start=at([0, 0, 0]), noise=0.01, rng=np.random.default_rng(0))
    controller, observed = Extremes(arm), []
    run = run_loop(plant, controller, np.zeros(3), 0.2, [lambda state, _: observed.append(state)])
    rows = np.flatnonzero(run.control_rows)
    seen = np.array([state.q for state in controller.seen])
    assert 0.005 < np.std(seen - run.q[rows]) < 0.015
    np.testing.assert_array_equal(seen, [state.q for state in observed])
    plain = PinocchioPlant(arm)
    plain.reset(at([0, 0, 0]))
    np.testing.assert_array_equal(follow(plain, run.tau)[:-1], np.c_[run.q, run.v])


def test_the_recording_holds_the_torques_that_acted(arm):
    plant = disturbed(arm, start=at([0, 0, 0]), delay=0.025)
    run = run_loop(plant, Extremes(arm), np.zeros(3), 0.1)
    limit = arm.limits.tau_max
    expected = [arm.gravity(np.zeros(3))] * 25 + [-limit] * 10 + [limit] * 10
    np.testing.assert_array_equal(run.tau[:45], expected)
    np.testing.assert_array_equal(run.u[:10], [-limit] * 10)
    assert summarise(run).torque_violations == 0


# ---- refusals ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: Push(np.nan, 0, 0.1), "push's t is nan"),
        (lambda: Push(0, 0, np.inf), "push's angle is inf"),
        (lambda: Wrench(np.inf, np.zeros(3), duration=1), "wrench's t is inf"),
        (lambda: Wrench(0, np.zeros(3), duration=0), "wrench's duration is 0"),
        (lambda: Wrench(0, np.zeros(2), duration=1), "wrench's force has shape"),
        (lambda: Wrench(0, np.zeros(3), [0, 0, np.nan], duration=1), "wrench's torque is"),
        (lambda: JointTorque(0, 0, np.nan, 1), "joint torque's torque is nan"),
        (lambda: JointTorque(0, 0, 1, -1), "joint torque's duration is -1"),
        (lambda: PayloadChange(np.nan, 1), "payload change's t is nan"),
        (lambda: PayloadChange(0, -1), "payload's mass is -1"),
        (lambda: PayloadChange(0, 1, (0, 0)), "payload's com has shape"),
    ],
)
def test_events_that_cannot_be_are_refused(make, reason):
    with pytest.raises(InputError, match=reason):
        make()


@pytest.mark.parametrize(
    ("what", "error", "reason"),
    [
        ({"pushes": [Push(0, "joint9", 1)]}, FrameNotFound, "no joint 'joint9'; this robot has"),
        ({"pushes": [Push(0, 3, 1)]}, InputError, "index from 0 to 2"),
        ({"wrenches": [JointTorque(0, -1, 1, 1)]}, InputError, "index from 0 to 2"),
        ({"delay": -0.1}, InputError, "delay is -0.1"),
        ({"delay": np.nan}, InputError, "delay is nan"),
        ({"noise": 0.1}, InputError, "noise needs a source"),
        ({"noise": -0.1, "rng": np.random.default_rng(0)}, InputError, "noise is"),
        ({"noise": np.nan, "rng": np.random.default_rng(0)}, InputError, "noise is"),
        ({"noise": [0.1], "rng": np.random.default_rng(0)}, InputError, "noise has shape"),
        (
            {"noise": 0.1, "velocity_filter": 0.0, "rng": np.random.default_rng(0)},
            InputError,
            "velocity_filter is 0.0",
        ),
    ],
)
def test_plants_that_cannot_be_are_refused(arm, what, error, reason):
    with pytest.raises(error, match=reason):
        DisturbedPlant(PinocchioPlant(arm), **what)


def test_bad_torques_are_refused_when_they_are_commanded(arm):
    plant = disturbed(arm, delay=0.1)
    for tau in ([np.nan, 0, 0], [0.0]):
        with pytest.raises(InputError, match="tau"):
            plant.step(tau)
    with pytest.raises(InputError, match="external_torque"):
        plant.plant.step(np.zeros(3), external_torque=[np.inf, 0, 0])
    with pytest.raises(InputError, match="tool_wrench has shape"):
        plant.plant.step(np.zeros(3), tool_wrench=np.zeros(3))
    with pytest.raises(InputError, match="change"):
        plant.plant.displace([0, 0, np.nan])
    with pytest.raises(InputError, match="needs 3"):
        plant.reset(JointState(0.0, np.zeros(2), np.zeros(2)))


# ---- the command line --------------------------------------------------------------------------


@pytest.fixture
def simulate(capsys, monkeypatch, tmp_path):
    """Return a function that simulates and returns (exit code, recording, stderr)."""

    def save(recording, metrics, folder):  # without the figures
        return [recording.save(folder / "run.npz")]

    monkeypatch.setattr("arm3dof.cli.simulate.write_run", save)

    def call(*words):
        words = ["simulate", "--target-deg", "0,0,0", "--duration", "0.5", *map(str, words)]
        code = app.main([*words, "--out", str(tmp_path), "--json"])
        captured = capsys.readouterr()
        if code == 2:
            assert captured.out == ""
            return code, None, captured.err
        assert set(json.loads(captured.out)) >= {"settled", "files"}
        return code, Recording.load(tmp_path / "run.npz"), captured.err

    return call


def said(run):
    """Return the notes but for the controller's settings."""
    return {name: note for name, note in run.notes.items() if not name.startswith("mpc.")}


def test_simulate_takes_disturbances(simulate, arm):
    _, calm, _ = simulate()
    assert said(calm) == {}
    assert calm.notes["mpc.horizon"] == "20"
    _, run, _ = simulate("--push", "0.1,joint2,10", "--push", "0.2,3,-5")
    assert run.q[100, 1] - run.q[99, 1] == pytest.approx(np.deg2rad(10), abs=1e-4)
    assert run.q[200, 2] - run.q[199, 2] == pytest.approx(np.deg2rad(-5), abs=1e-3)
    assert said(run) == {"pushes": "0.1,joint2,10; 0.2,3,-5"}
    _, run, _ = simulate("--wrench", "0.1,0,1,0,0.05")
    assert run.v[150, 0] > 0.1
    assert np.abs(run.q[:101] - calm.q[:101]).max() == 0
    _, run, _ = simulate("--payload-kg", "0.1")
    assert run.load_robot().payload.mass == 0.1
    assert run.q[:, 1].min() < calm.q[:, 1].min() - 0.002  # it sags until the load is learned
    _, run, _ = simulate("--model-error", "20", "--seed", "7")
    assert np.abs(run.load_robot().gravity(np.zeros(3)) - arm.gravity(np.zeros(3))).max() > 1e-3
    _, again, _ = simulate("--model-error", "20", "--seed", "7", "--noise-deg", "0.1")
    assert again.robot.urdf == run.robot.urdf
    assert said(again) == {"model_error": "20", "noise_deg": "0.1", "seed": "7"}
    assert np.abs(again.q - run.q).max() > 0
    _, run, _ = simulate("--delay-ms", "20", "--start-deg", "0,10,0")
    np.testing.assert_array_equal(run.tau[:20], np.tile(run.tau[0], (20, 1)))
    assert np.abs(run.tau[20] - run.tau[19]).max() > 1e-3


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--payload-kg", "-1"], "'--payload-kg'"),
        (["--payload-kg", "inf"], "mass is inf"),
        (["--push", "0.1,joint9,10"], "no joint 'joint9'; give a number from 1, or one of: joint1"),
        (["--push", "0.1,0,10"], "no joint '0'"),
        (["--push", "0.1,4,10"], "no joint '4'"),
        (["--push", "0.1,2"], "write T,JOINT,DEG"),
        (["--push", "0.1,2,far"], "give a number"),
        (["--push", "9,2,10"], "is at 9 s; give a time from 0 to below 0.5 s"),
        (["--push", "-1,2,10"], "is at -1 s"),
        (["--wrench", "0.1,1,2"], "write T,FX,FY,FZ,DURATION"),
        (["--wrench", "0.1,0,0,nan,1"], "give a finite number"),
        (["--wrench", "0.1,0,0,1,0"], "lasts 0 s"),
        (["--wrench", "1,0,0,1,1"], "is at 1 s"),
        (["--model-error", "100"], "percent is 100"),
        (["--noise-deg", "-0.1"], "'--noise-deg'"),
        (["--noise-deg", "inf"], "noise is"),
        (["--delay-ms", "-1"], "'--delay-ms'"),
        (["--delay-ms", "inf"], "delay is inf"),
        (["--seed", "-1"], "'--seed'"),
    ],
)
def test_simulate_refuses_disturbances_that_cannot_be(simulate, words, reason):
    code, _, err = simulate(*words)
    assert code == 2
    assert reason in err
    assert err.count("\n") == 1
