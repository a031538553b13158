"""The default formulation: exact where no limit acts, true tangents where one does."""

import numpy as np
import pinocchio as pin
import pytest

from arm3dof.control import solver
from arm3dof.control.horizon_torque import HorizonTorque
from arm3dof.control.motion import MotionMap
from arm3dof.control.mpc import MpcController
from arm3dof.control.program import sizes
from arm3dof.control.qp import QpStatus
from arm3dof.control.reference import JointTrajectory, sample_target
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus
from arm3dof.control.tracking import TrackingFormulation
from arm3dof.model.library import load_robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState


def random_arm(rng):
    name = ("arm3dof", "ur5", "panda")[rng.integers(3)]
    return perturbed(load_robot(name), 30, rng=rng)


def random_state(robot, rng):
    return JointState(0.0, robot.random_configuration(rng), rng.normal(size=robot.nv))


def program_of(robot, settings, rng):
    formulation = TrackingFormulation(robot, settings)
    state = random_state(robot, rng)
    reference = sample_target(robot.random_configuration(rng), robot.nv, 0.0, settings.dt, 5)
    return formulation.build(state, reference, None, 0.1 * rng.normal(size=robot.nv)), state


@pytest.mark.parametrize("blocks", [None, (1, 1, 2, 4)])
def test_a_motion_is_what_constant_accelerations_make(blocks):
    rng = np.random.default_rng(0)
    settings = MpcSettings(horizon=8, blocks=blocks)
    w = rng.normal(size=(8 if blocks is None else 4, 3))
    q, v = rng.normal(size=(2, 3))
    motion = MotionMap(settings)(q, v, w.ravel())
    dt = settings.dt
    for k, u in enumerate(w if blocks is None else np.repeat(w, blocks, axis=0)):
        np.testing.assert_allclose(motion.u[k], u, atol=1e-12)
        np.testing.assert_allclose(motion.v_middle[k], v + dt / 2 * u, atol=1e-12)
        np.testing.assert_allclose(motion.q_middle[k], q + dt / 2 * v + dt**2 / 8 * u, atol=1e-12)
        q, v = q + dt * v + dt**2 / 2 * u, v + dt * u
        np.testing.assert_allclose(motion.q[k], q, atol=1e-12)
        np.testing.assert_allclose(motion.v[k], v, atol=1e-12)


def test_torques_are_pinocchios_and_follow_the_masses():
    rng = np.random.default_rng(1)
    robot = load_robot("arm3dof").clone()
    torque = HorizonTorque(robot, 0.05, 20)
    motion = MotionMap(MpcSettings())(*rng.normal(size=(2, 3)), rng.normal(size=60))
    for _ in range(2):
        tau = np.zeros((20, 3))
        torque.add(motion.q_middle, motion.v_middle, motion.u, tau)
        for k, (q, v, u) in enumerate(zip(*motion[2:], strict=True)):
            rigid = pin.rnea(robot.model, robot.model.createData(), q, v, u)
            assert (np.abs(tau[k] - rigid) <= robot.damping * (np.abs(v) + np.abs(u)) + 1e-12).all()
        bodies = [body.copy() for body in robot.bodies]
        bodies[2].mass *= 2
        robot.reweigh(bodies)
        torque.refresh()


def test_tangents_are_derivatives_of_the_true_torque_along_the_plan():
    rng = np.random.default_rng(2)
    for _ in range(15):
        robot = random_arm(rng)
        program, _ = program_of(robot, MpcSettings(horizon=5), rng)
        w = rng.normal(size=5 * robot.nv)
        values = program.values(w).ravel()
        tangents = program.tangents(np.arange(2 * values.size), w)
        slopes = tangents.size[:, np.newaxis] * tangents.slopes
        touching = slopes @ w + tangents.size * tangents.offsets
        np.testing.assert_allclose(touching, np.concatenate((values, -values)), atol=1e-9)
        gram = np.einsum("ij,ij->i", tangents.through, tangents.slopes)
        moving = slopes.any(axis=1)
        np.testing.assert_allclose(gram[moving], 1.0, atol=1e-9)
        np.testing.assert_allclose(
            tangents.through, tangents.slopes @ program.hessian_inverse, atol=1e-9
        )
        for _ in range(3):
            way, step = rng.normal(size=w.size), 1e-5
            after, before = (program.values(w + sign * step * way) for sign in (1, -1))
            numeric = (after - before).ravel() / (2 * step)
            scale = max(np.abs(numeric).max(), 1.0)
            numeric = np.concatenate((numeric, -numeric))
            np.testing.assert_allclose(slopes @ way, numeric, atol=1e-6 * scale)


def test_a_tangent_that_rounding_has_spoilt_has_no_size_and_a_fixed_value_has_one():
    slopes = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    through = np.array([[4.0, 0.0], [0.0, 0.0], [0.0, -1e-20]])
    np.testing.assert_array_equal(sizes(slopes, through), [2.0, 1.0, np.nan])


def test_without_an_active_limit_the_answer_is_the_optimum_of_the_nonlinear_program():
    """Its torques are exact and inside the limits, and its gradient is zero: nothing is left."""
    rng, free = np.random.default_rng(3), 0
    for _ in range(30):
        robot = random_arm(rng)
        state = JointState(0.0, robot.random_configuration(rng), 0.05 * rng.normal(size=robot.nv))
        optimum = MpcController(robot).optimise(state, state.q + 0.05 * rng.normal(size=robot.nv))
        if optimum.working.b.size or optimum.status is not QpStatus.SOLVED:
            continue
        free += 1
        assert optimum.kkt_residual() <= 1e-6
        np.testing.assert_array_equal(optimum.w, optimum.program.w_free)
        np.testing.assert_array_equal(optimum.values, optimum.program.values(optimum.w))
    assert free > 15


def test_from_a_cold_start_exact_torques_keep_their_limits():
    rng = np.random.default_rng(4)
    overrides = {f"joint{i}.effort": 0.9 for i in (1, 2, 3)}
    robot, at_limit = load_robot("arm3dof", overrides=overrides), 0
    controller = MpcController(robot, MpcSettings(input_weight=1e-5))
    for _ in range(25):
        state = JointState(0.0, 0.8 * robot.random_configuration(rng), np.zeros(3))
        optimum = controller.optimise(state, 0.8 * robot.random_configuration(rng))
        assert optimum.status is QpStatus.SOLVED
        exact = np.abs(optimum.program.values(optimum.w)[0]) / robot.limits.tau_max
        assert exact.max() <= 1 + optimum.torque_error + 2e-6
        assert optimum.torque_error <= 0.01
        at_limit += bool(optimum.multipliers.any())
    assert at_limit > 20


def test_a_reference_that_stands_still_is_a_constant_target():
    robot, rng = load_robot("arm3dof"), np.random.default_rng(5)
    target = robot.random_configuration(rng)
    still = JointTrajectory([0.0, 1.0], [target, target])
    state = random_state(robot, rng)
    controller = MpcController(robot)
    one, other = (controller.optimise(state, aim) for aim in (target, still))
    np.testing.assert_allclose(one.program.w_free, other.program.w_free, atol=1e-8)


def test_a_slowing_arm_keeps_its_limits_with_one_dual_a_step(monkeypatch):
    robot, count = load_robot("arm3dof"), 0
    dual = solver.solve_box

    def counted(*args):
        nonlocal count
        count += 1
        return dual(*args)

    controller, plant = MpcController(robot), PinocchioPlant(robot, 0.005)
    rng = np.random.default_rng(0)
    _, _, start, target = (robot.random_configuration(rng) for _ in range(4))
    state = plant.reset(JointState(0.0, start, np.zeros(3)))
    step = controller.step(state, target)  # follows the optimum from rest, in many duals
    monkeypatch.setattr(solver, "solve_box", counted)
    duals = []
    for _ in range(15):
        for _ in range(10):
            state = plant.step(step.tau)
        count = 0
        step = controller.step(state, target)
        assert step.status is ControlStatus.SOLVED
        duals.append(count)
    assert max(duals) == 1
    assert sum(duals) > 10
