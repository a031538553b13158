"""PD, PD + gravity, PID and computed torque: the laws, their gains, and never nonsense."""

import numpy as np
import pytest

from arm3dof.control import baselines
from arm3dof.control.baselines import BaselineController, ComputedTorqueLaw, PdLaw, PidLaw
from arm3dof.control.mpc import MpcController
from arm3dof.control.reference import JointTrajectory
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.control.tuning import FrozenArms, Gains, tune_gains
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import summarise
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

DT = 0.05
GAINS = Gains([0.06, 0.08, 0.04], [0.0065, 0.02, 0.0014], [0.1, 0.2, 0.1])
TARGET = np.deg2rad([28.1, 67.8, 53.8])


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


@pytest.fixture(scope="module")
def tuned(robot):
    return {
        "pd": tune_gains(robot, DT),
        "pd_gravity": tune_gains(robot, DT, carries_weight=True),
    }


def every(robot):
    return {
        "pd": baselines.pd(robot, gains=GAINS),
        "pd_gravity": baselines.pd_gravity(robot, gains=GAINS),
        "pid": baselines.pid(robot, gains=GAINS),
        "computed_torque": baselines.computed_torque(robot),
    }


NAMES = ("pd", "pd_gravity", "pid", "computed_torque")


def random_state(robot, rng, t=0.0):
    return JointState(t, robot.random_configuration(rng), rng.normal(size=robot.nv))


def hostile_state(robot, rng):
    q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
    kind = rng.integers(5)
    if kind == 1:
        q, v = q * 100, v * 100
    elif kind == 2:
        q, v = q * 10 ** rng.uniform(0, 300), v * 10 ** rng.uniform(0, 300)
    elif kind == 3:
        q[rng.integers(robot.nv)] = rng.choice([np.nan, np.inf, -np.inf])
    elif kind == 4:
        v[rng.integers(robot.nv)] = rng.choice([np.nan, np.inf, -np.inf])
    return JointState(0.0, q, v)


@pytest.mark.parametrize("name", NAMES)
def test_no_input_makes_a_torque_that_is_not_safe(robot, name):
    rng = np.random.default_rng(3)
    controller = every(robot)[name]
    seen = set()
    for _ in range(400):
        state = hostile_state(robot, rng)
        target = robot.random_configuration(rng) * rng.choice([1.0, 10.0, 1e300, np.nan, np.inf])
        step = controller.step(state, target)
        assert np.isfinite(step.tau).all()
        assert (np.abs(step.tau) <= robot.limits.tau_max).all()
        assert np.isfinite(step.u).all()
        if not state.is_finite:
            assert step.status is ControlStatus.BAD_MEASUREMENT
        elif not np.isfinite(target).all():
            assert step.status is ControlStatus.BAD_TARGET
        solved = step.status is ControlStatus.SOLVED
        assert step.source is (TorqueSource.OPTIMUM if solved else TorqueSource.BRAKING)
        seen.add(step.status)
    expected = {ControlStatus.SOLVED, ControlStatus.BAD_MEASUREMENT, ControlStatus.BAD_TARGET}
    assert seen == expected


@pytest.mark.parametrize("name", NAMES)
def test_a_lost_measurement_holds_the_arm_where_it_was_last_seen(robot, name):
    controller = every(robot)[name]
    lost = JointState(0.0, [np.nan] * 3, np.zeros(3))
    np.testing.assert_array_equal(controller.step(lost, TARGET).tau, 0.0)
    q = np.array([0.3, 0.5, -0.2])
    controller.step(JointState(0.0, q, np.zeros(3)), TARGET)
    np.testing.assert_allclose(controller.step(lost, TARGET).tau, robot.gravity(q))
    controller.reset()
    np.testing.assert_array_equal(controller.step(lost, TARGET).tau, 0.0)


def test_a_bad_target_holds_the_arm_where_it_is(robot):
    controller = baselines.computed_torque(robot)
    q = np.array([0.1, 0.9, -0.4])
    step = controller.step(JointState(0.0, q, np.zeros(3)), [np.nan, 0, 0])
    np.testing.assert_allclose(step.tau, robot.gravity(q))


def test_the_laws_are_what_they_say(robot):
    rng = np.random.default_rng(1)
    for _ in range(50):
        state, target = random_state(robot, rng), robot.random_configuration(rng)
        limit = robot.limits.tau_max
        proportional = GAINS.position * (target - state.q) - GAINS.velocity * state.v
        expected = {
            "pd": proportional,
            "pid": proportional,  # nothing is integrated yet
            "pd_gravity": proportional + robot.gravity(state.q),
        }
        for name, tau in expected.items():
            step = every(robot)[name].step(state, target)
            np.testing.assert_allclose(step.tau, np.clip(tau, -limit, limit))
            accelerations = robot.forward_dynamics(state.q, state.v, step.tau)
            np.testing.assert_allclose(step.u, accelerations)
            np.testing.assert_array_equal(step.plan, [np.r_[target - state.q, state.v]])


def test_computed_torque_asks_for_what_unlimited_mpc_asks_for(robot):
    overrides = {}
    for joint in robot.joint_names:
        overrides |= {
            f"{joint}.effort": 1e4,
            f"{joint}.velocity": 1e4,
            f"{joint}.lower": -1e3,
            f"{joint}.upper": 1e3,
            f"{joint}.damping": 0.0,
        }
    free = load_robot("arm3dof", overrides=overrides)
    rng = np.random.default_rng(2)
    for _ in range(20):
        state = JointState(0.0, rng.uniform(-2, 2, 3), rng.normal(size=3))
        target = rng.uniform(-2, 2, 3)
        wanted = MpcController(free, MpcSettings(horizon=40)).step(state, target)
        step = baselines.computed_torque(free).step(state, target)
        np.testing.assert_allclose(step.u, wanted.u, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_a_trajectory_is_followed_by_its_velocity_and_acceleration(robot, name):
    controller = every(robot)[name]
    path = JointTrajectory([0.0, 1.0, 2.0], [np.zeros(3), TARGET, np.zeros(3)])
    now, after = (path.sample([t]) for t in (0.5, 0.5 + DT))
    on_path = JointState(0.5, now.q[0], now.v[0])
    tau = controller.step(on_path, path).tau
    accelerations = (after.v[0] - now.v[0]) / DT
    if name == "computed_torque":
        held = robot.forward_dynamics(on_path.q, on_path.v, tau)
        np.testing.assert_allclose(held, accelerations, rtol=0.3, atol=0.5)
    elif name == "pd_gravity":
        np.testing.assert_allclose(tau, robot.gravity(on_path.q))
    else:
        np.testing.assert_allclose(tau, 0.0, atol=1e-12)


def test_the_integral_holds_what_the_error_has_added_and_stops_at_the_limits():
    law = PidLaw(GAINS, DT)
    robot = load_robot("arm3dof")
    controller = BaselineController(robot, law, DT)
    state = JointState(0.0, np.zeros(3), np.zeros(3))
    e = np.array([0.1, -0.2, 0.3])
    first = controller.step(state, e).tau
    second = controller.step(state, e).tau
    np.testing.assert_allclose(second - first, DT * GAINS.integral * e)
    far = np.array([1e3, -1e3, 1e3])
    before = controller.step(state, np.zeros(3)).tau
    for _ in range(100):
        np.testing.assert_allclose(np.abs(controller.step(state, far).tau), robot.limits.tau_max)
    np.testing.assert_allclose(controller.step(state, np.zeros(3)).tau, before)


def test_a_wound_integral_may_unwind():
    law = PidLaw(Gains([1.0], [0.0], [40.0]), DT)
    robot = load_robot("arm3dof", locked_joints={"joint2": 0.0, "joint3": 0.0})
    controller = BaselineController(robot, law, DT)
    state = JointState(0.0, np.zeros(1), np.zeros(1))
    controller.step(state, [0.9])
    up = [controller.step(state, [0.9]).tau[0] for _ in range(3)]
    assert up[-1] == robot.limits.tau_max[0]
    down = [controller.step(state, [-0.1]).tau[0] for _ in range(60)]
    assert down[-1] < 0


def test_tuned_gains_beat_gains_turned_either_way(robot, tuned):
    for name, carries in (("pd", False), ("pd_gravity", True)):
        trials, best = FrozenArms(robot, DT, carries_weight=carries), tuned[name]
        least = trials.cost(best)
        assert least < 1
        for factor in (0.7, 1.4):
            for joint in range(3):
                turned = np.ones(3)
                turned[joint] = factor
                for position, velocity in ((turned, 1.0), (np.ones(3), turned)):
                    other = Gains(best.position * position, best.velocity * velocity, np.zeros(3))
                    assert trials.cost(other) > least


def test_an_unstable_trial_is_lost_but_finite(robot):
    trials = FrozenArms(robot, DT, carries_weight=True)
    wild = Gains(np.full(3, 1e9), np.full(3, 1e9), np.full(3, 1e9))
    assert 0.9 < trials.cost(wild) <= 1.0


def test_the_cost_of_a_frozen_arm_is_that_of_a_simulated_one(robot):
    """For one joint about the vertical the frozen arm is exact, so both must agree."""
    one = load_robot("arm3dof", locked_joints={"joint2": 0.5, "joint3": 0.2})
    gains = Gains([0.3], [0.05], [0.0])
    plant = PinocchioPlant(one, 0.001)
    plant.reset(JointState(0.0, np.zeros(1), np.zeros(1)))
    recording = run_loop(plant, baselines.pd(one, gains=gains), [0.5], 4.0)
    at = recording.control_rows
    v = np.r_[recording.v[at][:, 0], recording.v[-1, 0]]
    settings = MpcSettings()
    mean = np.mean(recording.e[at] ** 2) + settings.input_weight * np.mean((np.diff(v) / DT) ** 2)
    cost = FrozenArms(one, DT, carries_weight=False).cost(gains)
    assert cost == pytest.approx(mean / (mean + 1), rel=1e-3)


def test_gravity_compensation_and_computed_torque_reach_the_target_and_pd_sags(robot, tuned):
    finals = {}
    for name, controller in {
        "pd": baselines.pd(robot, gains=tuned["pd"]),
        "pd_gravity": baselines.pd_gravity(robot, gains=tuned["pd_gravity"]),
        "computed_torque": baselines.computed_torque(robot),
    }.items():
        plant = PinocchioPlant(robot, 0.0025)
        plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
        finals[name] = summarise(run_loop(plant, controller, TARGET, 4.0)).final_error
    assert finals["computed_torque"] < np.deg2rad(0.1)
    assert finals["pd_gravity"] < np.deg2rad(1.0)
    assert np.deg2rad(2.0) < finals["pd"] < np.deg2rad(45.0)


def test_wrong_shapes_and_numbers_are_refused_by_name(robot):
    controller = baselines.computed_torque(robot)
    with pytest.raises(InputError, match="the state has 2 joints; arm3dof has 3"):
        controller.step(JointState(0.0, np.zeros(2), np.zeros(2)), TARGET)
    with pytest.raises(InputError, match="q_target has shape"):
        controller.step(JointState(0.0, np.zeros(3), np.zeros(3)), [1.0])
    with pytest.raises(InputError, match="dt is -1"):
        BaselineController(robot, PdLaw(GAINS), -1)
    with pytest.raises(InputError, match="velocity"):
        Gains([1.0, 2.0], [1.0], [0.0, 0.0])


def test_results_cannot_be_written_to(robot):
    for controller in every(robot).values():
        step = controller.step(JointState(0.0, np.zeros(3), np.zeros(3)), TARGET)
        for array in (step.tau, step.u, step.plan):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 9.0


@pytest.mark.slow
def test_another_arm_is_tuned_too():
    robot = load_robot("arm3dof", locked_joints={"joint1": 0.0})
    gains = tune_gains(robot, DT, integrates=True)
    assert gains.position.shape == (2,)
    assert all((part > 0).all() for part in (gains.position, gains.velocity, gains.integral))
    law = ComputedTorqueLaw(robot, DT, position=25.0, velocity=7.0)
    step = BaselineController(robot, law, DT).step(
        JointState(0.0, np.zeros(2), np.zeros(2)), [0.2, 0.1]
    )
    assert step.status is ControlStatus.SOLVED
