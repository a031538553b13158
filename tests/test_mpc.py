"""The controller: the paper's gain, optimal under limits, and never nonsense."""

import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from arm3dof.control import solver
from arm3dof.control.bounds import Bounds
from arm3dof.control.mpc import MpcController
from arm3dof.control.paper import PaperFormulation
from arm3dof.control.qp import ProxqpWorkspace, QpStatus
from arm3dof.control.reference import JointTrajectory
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import summarise
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

PAPER_TARGET = np.deg2rad([28.1, 67.8, 53.8])


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


def weak(robot, effort):
    return load_robot("arm3dof", overrides={f"{name}.effort": effort for name in robot.joint_names})


def random_state(robot, rng, speed=1.0):
    return JointState(0.0, robot.random_configuration(rng), rng.normal(size=robot.nv) * speed)


def assert_safe(step, robot):
    assert np.isfinite(step.tau).all()
    assert (np.abs(step.tau) <= robot.limits.tau_max).all()
    assert isinstance(step.status, ControlStatus)
    assert step.status.sentence
    assert step.source.sentence


@pytest.mark.parametrize("discretisation", ["euler", "exact"])
@pytest.mark.parametrize("horizon", [1, 5, 20])
def test_without_active_limits_the_first_input_is_the_closed_form_gain(discretisation, horizon):
    free = load_robot(
        "arm3dof",
        overrides={
            f"joint{i}.{key}": value
            for i in (1, 2, 3)
            for key, value in {
                "effort": 1e4,
                "velocity": 1e4,
                "lower": -1e3,
                "upper": 1e3,
                "damping": 0.0,
            }.items()
        },
    )
    settings = MpcSettings(formulation="paper", horizon=horizon, discretisation=discretisation)
    controller, formulation = MpcController(free, settings), PaperFormulation(free, settings)
    rng = np.random.default_rng(horizon)
    for _ in range(20):
        state = JointState(0.0, rng.uniform(-2, 2, 3), rng.normal(size=3))
        target = rng.uniform(-2, 2, 3)
        cost = formulation.cost(formulation.predict(state))
        x = np.r_[target - state.q, state.v]
        expected = -np.linalg.solve(cost.H, cost.M.T @ x)[:3]
        step = controller.step(state, target)
        assert step.status is ControlStatus.SOLVED
        np.testing.assert_allclose(step.u, expected, atol=1e-6, rtol=1e-6)
        tau = free.mass_matrix(state.q) @ step.u + free.gravity(state.q)
        np.testing.assert_allclose(step.tau, tau, atol=1e-9)


def test_with_active_limits_the_solution_satisfies_the_kkt_conditions(robot):
    rng = np.random.default_rng(1)
    controller = MpcController(weak(robot, 0.5))
    at_limit = 0
    for _ in range(100):
        state = random_state(robot, rng)
        optimum = controller.optimise(state, robot.random_configuration(rng))
        assert optimum.status is QpStatus.SOLVED
        assert optimum.kkt_residual() <= 1e-6
        at_limit += bool((optimum.multipliers > 1e-3).any())
    assert at_limit > 50


@pytest.mark.parametrize("formulation", ["tracking", "torque", "paper"])
def test_the_optimum_is_that_of_the_qp_with_every_limit(robot, formulation):
    rng = np.random.default_rng(4)
    tight = {
        f"joint{i}.{key}": x
        for i in (1, 2, 3)
        for key, x in {"effort": 0.5, "velocity": 1.5}.items()
    }
    limited = load_robot("arm3dof", overrides=tight)
    controller = MpcController(limited, MpcSettings(formulation=formulation))
    compared = limits_active = 0
    for _ in range(40):
        state = JointState(0.0, 0.8 * robot.random_configuration(rng), rng.normal(size=3) * 0.3)
        optimum = controller.optimise(state, 0.8 * robot.random_configuration(rng))
        if optimum.softened or optimum.status is not QpStatus.SOLVED:
            continue
        qp = optimum.quadratic_program()
        solution = ProxqpWorkspace(qp.g.size, qp.lower.size).solve(qp)
        if solution.status is QpStatus.SOLVED:
            np.testing.assert_allclose(optimum.w, solution.x, atol=1e-4)
            compared += 1
            limits_active += bool((optimum.multipliers > 1e-3).any())
    assert compared > 25
    assert limits_active > 20


def test_every_limit_of_the_full_program_holds_in_the_prediction(robot):
    rng = np.random.default_rng(2)
    slow = load_robot("arm3dof", overrides={f"joint{i}.velocity": 2.0 for i in (1, 2, 3)})
    controller = MpcController(slow)
    limits = slow.limits
    for _ in range(50):
        state = JointState(0.0, 0.9 * slow.random_configuration(rng), rng.normal(size=3) * 0.5)
        target = slow.random_configuration(rng)
        step = controller.step(state, target)
        assert step.status in (ControlStatus.SOLVED, ControlStatus.SOFTENED)
        if step.status is ControlStatus.SOLVED:
            e, v = np.split(step.plan, 2, axis=1)
            assert (np.abs(v) <= limits.v_max + 1e-5).all()
            assert (target - e <= limits.q_max + 1e-5).all()
            assert (target - e >= limits.q_min - 1e-5).all()


@pytest.mark.parametrize("formulation", ["tracking", "torque", "paper"])
def test_the_papers_experiment_settles_inside_every_limit(robot, formulation):
    plant = PinocchioPlant(robot, dt=0.0025)
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
    recording = run_loop(
        plant, MpcController(robot, MpcSettings(formulation=formulation)), PAPER_TARGET, 6.0
    )
    metrics = summarise(recording)
    assert metrics.settled
    assert metrics.settling_time < 3.0
    assert metrics.final_error < 1e-4
    assert (np.abs(recording.tau) <= 1.96).all()
    assert metrics.velocity_violations == metrics.position_violations == 0
    np.testing.assert_allclose(recording.tau[-1], robot.gravity(PAPER_TARGET), atol=1e-3)


def test_under_euler_an_arm_near_its_joint_range_is_solved_as_under_exact_discretisation(robot):
    """No decision reaches Euler's first position; a limit of it must not spoil the others."""
    rng, highest, solved = np.random.default_rng(0), robot.limits.q_max, 0
    for _ in range(15):
        controllers = [
            MpcController(robot, MpcSettings(discretisation=one)) for one in ("exact", "euler")
        ]
        q, v, joint = robot.random_configuration(rng), np.zeros(3), rng.integers(3)
        q[joint] = highest[joint] - rng.uniform(0.02, 0.1)
        v[joint] = rng.uniform(0.2, 1.0) * robot.limits.v_max[joint]
        for step in range(4):
            state = JointState(controllers[0].dt * step, q, v)
            exact, euler = (one.step(state, 0.999 * highest).status for one in controllers)
            q, v = q + controllers[0].dt * v, 0.6 * v
            if exact is not ControlStatus.NOT_SOLVED:
                assert euler is not ControlStatus.NOT_SOLVED
                solved += 1
    assert solved > 45


def test_a_target_outside_the_joint_range_is_approached_to_the_limit(robot):
    target = np.array([0.0, robot.limits.q_max[1] + 0.5, 0.0])
    plant = PinocchioPlant(robot)
    plant.reset(JointState(0.0, np.array([0.0, 3.0, 0.0]), np.zeros(3)))
    recording = run_loop(plant, MpcController(robot), target, 3.0)
    assert recording.q[-1][1] == pytest.approx(robot.limits.q_max[1], abs=0.01)
    assert recording.q[:, 1].max() < robot.limits.q_max[1] + 0.01


def hostile_state(robot, rng):
    q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
    kind = rng.integers(6)
    if kind == 1:
        q = q + rng.normal(size=robot.nv) * 3
    elif kind == 2:
        v = v * 20
    elif kind == 3:
        q, v = q * 10 ** rng.uniform(0, 200), v * 10 ** rng.uniform(0, 200)
    elif kind == 4:
        q[rng.integers(robot.nv)] = rng.choice([np.nan, np.inf, -np.inf])
    elif kind == 5:
        v[rng.integers(robot.nv)] = rng.choice([np.nan, np.inf, -np.inf])
    return JointState(0.0, q, v)


def fuzz(robot, settings, seed, steps):
    rng = np.random.default_rng(seed)
    controller = MpcController(robot, settings)
    for _ in range(steps):
        target = robot.random_configuration(rng) * rng.choice([1.0, 1.0, 5.0, np.nan])
        state = hostile_state(robot, rng)
        step = controller.step(state, target)
        assert_safe(step, robot)
        if not state.is_finite:
            assert step.status is ControlStatus.BAD_MEASUREMENT
        elif not np.isfinite(target).all() and step.status is not ControlStatus.BAD_MEASUREMENT:
            assert step.status is ControlStatus.BAD_TARGET
        good, aim = random_state(robot, rng, 0.5), robot.random_configuration(rng)
        # what was learned from states that fit, and commands on their way, may rightly count; and
        # a cost without input weight is singular, so rounding decides whether it is solved
        learned = bool(controller.observer.disturbance.any())
        counts = learned or settings.delay > 0 or settings.torque_rate is not None
        counts = counts or settings.input_weight == 0
        if rng.random() < 0.1 and settings.max_iterations > 1 and not counts:
            after, fresh = (
                controller.step(good, aim),
                MpcController(robot, settings).step(good, aim),
            )
            assert after.status == fresh.status
            np.testing.assert_allclose(after.tau, fresh.tau, atol=1e-6)


FUZZED = {
    "default": MpcSettings(),
    "paper": MpcSettings(formulation="paper"),
    "torque": MpcSettings(formulation="torque"),
    "torque rate": MpcSettings(torque_rate=5.0),
    "blocks and delay": MpcSettings(blocks=(1, 1, 2, 4, 12), delay=0.08),
    "one stage": MpcSettings(horizon=1),
    "no weights": MpcSettings(state_weight=(0, 0), input_weight=0, terminal_weight=(0, 0)),
    "no input weight": MpcSettings(input_weight=0, terminal_weight=(1, 1)),
    "one iteration": MpcSettings(max_iterations=1),
}


@pytest.mark.parametrize("name", FUZZED)
def test_no_input_makes_a_torque_that_is_not_safe(robot, name):
    fuzz(robot, FUZZED[name], seed=7, steps=60)


@pytest.mark.slow
@pytest.mark.parametrize("name", FUZZED)
def test_many_hostile_steps(robot, name):
    fuzz(weak(robot, 0.8), FUZZED[name], seed=11, steps=150)


def test_a_lost_measurement_is_bridged_by_the_plan_and_then_by_holding(robot):
    controller = MpcController(robot)
    start = JointState(0.0, np.zeros(3), np.zeros(3))
    good = controller.step(start, PAPER_TARGET)
    lost = JointState(0.0, np.full(3, np.nan), np.zeros(3))
    steps = [controller.step(lost, PAPER_TARGET) for _ in range(8)]
    assert {step.status for step in steps} == {ControlStatus.BAD_MEASUREMENT}
    planned = [TorqueSource.PREVIOUS_PLAN] * 5 + [TorqueSource.BRAKING] * 3
    assert [step.source for step in steps] == planned
    q, v = PAPER_TARGET - good.plan[1, :3], good.plan[1, 3:]
    assert steps[0].tau == pytest.approx(robot.inverse_dynamics(q, v, steps[0].u))
    held = PAPER_TARGET - good.plan[8, :3]
    assert steps[-1].tau == pytest.approx(robot.gravity(held))


def test_without_any_good_measurement_the_torque_is_zero(robot):
    lost = JointState(0.0, np.full(3, np.nan), np.zeros(3))
    step = MpcController(robot).step(lost, PAPER_TARGET)
    np.testing.assert_array_equal(step.tau, 0.0)
    assert (step.status, step.source) == (ControlStatus.BAD_MEASUREMENT, TorqueSource.BRAKING)


def test_braking_brings_a_moving_arm_to_rest(robot):
    controller = MpcController(robot, MpcSettings(max_iterations=1, tolerance=1e-14))
    plant = PinocchioPlant(robot)
    plant.reset(JointState(0.0, np.zeros(3), np.array([2.0, -1.0, 3.0])))
    weak_target = np.array([2.0, 2.0, -2.0])
    recording = run_loop(plant, controller, weak_target * np.nan, 1.0)
    assert set(recording.source) == {TorqueSource.BRAKING}
    assert np.abs(recording.v[-1]).max() < 0.05


def test_a_missed_deadline_is_reported(robot):
    controller = MpcController(robot, MpcSettings(max_step_time=1e-9))
    step = controller.step(JointState(0.0, np.zeros(3), np.zeros(3)), PAPER_TARGET)
    assert step.status is ControlStatus.DEADLINE_MISSED
    assert_safe(step, robot)


def test_wrong_shapes_and_settings_are_refused_by_name(robot):
    controller = MpcController(robot)
    with pytest.raises(InputError, match="q_target has shape"):
        controller.step(JointState(0.0, np.zeros(3), np.zeros(3)), [1.0])
    with pytest.raises(InputError, match="the state has 2 joints; arm3dof has 3"):
        controller.step(JointState(0.0, np.zeros(2), np.zeros(2)), PAPER_TARGET)
    bad = {
        "horizon": 0,
        "dt": -1.0,
        "formulation": "magic",
        "discretisation": "tustin",
        "limit_weight": 0.0,
        "max_iterations": 0,
        "tolerance": 0.0,
        "max_step_time": -1.0,
        "plan_validity": -0.1,
    }
    for name, value in bad.items():
        with pytest.raises(InputError, match=name):
            MpcSettings(**{name: value})
    with pytest.raises(InputError, match="state_weight"):
        MpcController(robot, MpcSettings(state_weight=(1, 2, 3)))


def test_results_cannot_be_written_to(robot):
    step = MpcController(robot).step(JointState(0.0, np.zeros(3), np.zeros(3)), PAPER_TARGET)
    for array in (step.tau, step.u, step.plan):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


@pytest.mark.parametrize("name", ["ur5", "panda", "z1", "so100", "so101", "xarm7"])
def test_arms_of_the_library_settle(name):
    other = load_robot(name)
    limits = other.limits
    start = np.clip(np.zeros(other.nv), limits.q_min, limits.q_max)
    span = np.minimum(limits.q_max - limits.q_min, 2.0)
    signs = np.sign(np.random.default_rng(0).normal(size=other.nv))
    target = np.clip(start + 0.25 * signs * span, limits.q_min + 0.02, limits.q_max - 0.02)
    plant = PinocchioPlant(other, dt=0.002)
    plant.reset(JointState(0.0, start, np.zeros(other.nv)))
    metrics = summarise(run_loop(plant, MpcController(other), target, 2.0))
    assert metrics.settled
    assert metrics.torque_violations == 0


def test_a_joint_that_is_too_fast_is_slowed_down_in_stages_and_not_at_once(robot):
    rng = np.random.default_rng(8)
    limits = robot.limits
    for _ in range(10):
        v = limits.v_max * rng.choice([-1, 1], 3) * rng.uniform(0.2, 1.5, 3)
        state = JointState(0.0, 0.3 * robot.random_configuration(rng), v)
        step = MpcController(robot).step(state, state.q)
        excess = np.maximum(np.abs(step.plan[:, 3:]) - limits.v_max, 0.0)
        if step.status is ControlStatus.SOLVED:  # as the torque allows
            assert (excess[1:] <= 0.7 * excess[0] + 1e-5).all()
        assert (excess[-1] < 0.05 * limits.v_max).all()


def test_a_target_that_is_absurdly_far_pulls_as_hard_as_one_that_is_only_far(robot):
    state = JointState(0.0, np.zeros(3), np.zeros(3))
    for far in (1e3, 1e50, 1e200):
        step = MpcController(robot).step(state, np.array([far, 0.5, -far]))
        expected = MpcController(robot).step(state, np.array([50.0, 0.5, -50.0]))
        assert step.status is expected.status
        np.testing.assert_allclose(step.tau, expected.tau, atol=1e-6)


def test_a_far_target_is_moved_nearer_in_every_step(robot):
    target = np.array([50.2, 0.5, -50.0])
    controller = MpcController(robot)
    for k, q in enumerate((0.3, 0.1, -0.1)):
        state = JointState(controller.dt * k, np.full(3, q), np.zeros(3))
        error = controller.step(state, target).plan[0, :3]
        np.testing.assert_allclose(error, np.clip(target - q, -50.0, 50.0), rtol=0, atol=1e-12)
    far_later = JointTrajectory([0.0, 0.1, 0.2], np.outer([0.0, 0.0, 1e3], np.ones(3)))
    reference = controller._within_reach(far_later.sample([0.0, 0.2]), state)
    np.testing.assert_allclose(reference.q, np.outer([0.0, 49.9], np.ones(3)))


def test_an_answer_puts_its_plan_together_when_read_and_stays_immutable(robot):
    state = JointState(0.0, np.array([0.2, 0.4, -0.3]), np.zeros(3))
    target = np.array([0.5, 0.1, 0.2])
    controller = MpcController(robot)
    step = controller.step(state, target)
    copy = pickle.loads(pickle.dumps(step))
    controller.step(JointState(controller.dt, state.q, state.v), -target)
    assert step.plan is step.plan
    np.testing.assert_array_equal(step.plan[0], np.concatenate([target - state.q, state.v]))
    np.testing.assert_array_equal(copy.plan, step.plan)
    for array in (step.tau, step.u, step.plan):
        assert not array.flags.writeable
    with pytest.raises(FrozenInstanceError):
        step.plan = target
    stopped = replace(step, plan=step.plan[:1])
    assert stopped.plan.shape == (1, 6)
    assert stopped.tau is step.tau
    assert "plan=array(" in repr(step)


def test_the_work_of_a_step_is_bounded_and_ends_at_the_deadline(robot):
    rng = np.random.default_rng(9)
    controller = MpcController(weak(robot, 0.05))
    hopeless = 0
    for _ in range(20):
        state = random_state(robot, rng, 5.0)
        step = controller.step(state, robot.random_configuration(rng))
        assert_safe(step, controller.robot)
        hopeless += step.status is ControlStatus.NOT_SOLVED
        assert controller._solver._work <= solver._MOST_WORK
    assert hopeless
    late = MpcController(robot)._solver
    late.begin(deadline=0.0)
    assert not late._affords(0.1)


def test_limits_are_broken_where_the_excess_is_larger_than_the_tolerance(robot):
    rng = np.random.default_rng(12)
    bounds = Bounds.of(robot.limits, robot.limits.tau_max, 1.0, 10)
    for _ in range(50):
        values = 1.2 * np.where(rng.random((3, 10, 3)) < 0.5, bounds.low, bounds.high)
        values *= rng.uniform(-1.0, 1.0, values.shape)
        expected = (bounds.excess(values) > bounds.tolerance).ravel().nonzero()[0]
        np.testing.assert_array_equal(bounds.broken(values), expected)
        assert bounds.keep(values) is not bool(expected.size)
    values[0, 0, 0] = np.nan
    assert not bounds.keep(values)
