"""The plant: energy, friction that sticks, damping that decays, and inputs that are checked."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

FREE = {f"joint{i}.damping": 0.0 for i in (1, 2, 3)}


def at(q, v=(0.0, 0.0, 0.0)):
    return JointState(0.0, np.array(q, float), np.array(v, float))


def test_the_free_arm_keeps_its_energy():
    plant = PinocchioPlant(load_robot("arm3dof", overrides=FREE), dt=0.0005)
    plant.reset(at([0.3, 0.4, -0.5], [1.0, -2.0, 3.0]))
    start = plant.energy()
    drift = 0.0
    for _ in range(20_000):
        plant.step(np.zeros(3))
        drift = max(drift, abs(plant.energy() - start))
    assert plant.state.t == pytest.approx(10.0)
    assert drift < 1e-6


def test_damped_motion_agrees_with_an_independent_integrator():
    robot = load_robot("arm3dof", overrides={f"joint{i}.damping": 0.02 for i in (1, 2, 3)})
    plant = PinocchioPlant(robot, dt=0.0005)
    q, v, tau = np.array([0.1, 0.2, 0.3]), np.array([1.0, -1.0, 2.0]), np.array([0.01, 0.3, 0.1])
    plant.reset(at(q, v))
    for _ in range(1000):
        state = plant.step(tau)

    def rate(_, x):
        return np.r_[x[3:], robot.forward_dynamics(x[:3], x[3:], tau)]

    path = solve_ivp(rate, (0, 0.5), np.r_[q, v], rtol=1e-11, atol=1e-12, method="DOP853")
    np.testing.assert_allclose(np.r_[state.q, state.v], path.y[:, -1], atol=1e-8)


def test_gravity_torque_holds_the_arm_for_ever():
    robot = load_robot("arm3dof")
    plant = PinocchioPlant(robot)
    q = np.array([0.5, 0.6, 0.7])
    plant.reset(at(q))
    for _ in range(2000):
        state = plant.step(robot.gravity(q))
    np.testing.assert_allclose(state.q, q, atol=1e-9)


def test_dry_friction_holds_below_its_limit_and_yields_above_it():
    friction = 0.1
    robot = load_robot(
        "arm3dof", overrides={f"joint{i}.friction": friction for i in (1, 2, 3)} | FREE
    )
    q = np.array([0.2, 0.3, 0.4])
    for push, moves in ((0.95 * friction, False), (1.2 * friction, True)):
        plant = PinocchioPlant(robot)
        plant.reset(at(q))
        for _ in range(200):
            state = plant.step(robot.gravity(q) + np.array([push, 0.0, 0.0]))
        assert bool(abs(state.q[0] - q[0]) > 1e-3) is moves
        if not moves:
            np.testing.assert_array_equal(state.v, 0.0)


@pytest.mark.parametrize("name", ["arm3dof", "so101", "xarm7"])
def test_friction_and_stops_leave_the_velocity_that_minimises_the_convex_program(name):
    """Its gradient is zero where a joint slides, inside the cone where it sticks, and pushes where
    it is stopped."""
    rng, stuck, stopped = np.random.default_rng(0), 0, 0
    joints = load_robot(name).joint_names
    robot = load_robot(name, overrides={f"{joint}.friction": 0.05 for joint in joints})
    plant, nv = PinocchioPlant(robot, end_stops=True), robot.nv
    for _ in range(100):
        q = robot.random_configuration(rng)
        at_end = rng.random(nv) < 0.2
        q[at_end] = robot.limits.q_max[at_end]
        plant.reset(JointState(0.0, q, np.zeros(nv)))
        free = rng.normal(size=nv) * rng.choice([1e-3, 1e-2, 1.0], nv)
        v = plant._rub(free)
        mass = robot.mass_matrix(q)
        pull = mass @ (free - v) - plant.dt * plant._implicit_damping * v
        dry = plant.dt * robot.friction
        slides, held = np.sign(v) * dry, (q >= robot.limits.q_max) & (v == 0.0)
        scale = mass.diagonal()
        moves = v != 0.0
        assert (np.abs(pull - slides)[moves] <= 1e-9 * scale[moves]).all()
        assert (pull[~moves] >= -dry[~moves] - 1e-9 * scale[~moves]).all()
        sticks = ~moves & ~held
        assert (pull[sticks] <= dry[sticks] + 1e-9 * scale[sticks]).all()
        assert (v[q >= robot.limits.q_max] <= 0.0).all()
        stuck, stopped = stuck + int(sticks.sum()), stopped + int((held & (pull > dry)).sum())
    assert stuck > 20
    assert stopped > 5


def test_sliding_friction_takes_the_energy_that_coulomb_says():
    friction = 0.05
    robot = load_robot("arm3dof", overrides={"gravity.z": 0.0, "joint1.friction": friction} | FREE)
    plant = PinocchioPlant(robot)
    plant.reset(at([0.0, 0.5, 0.5], [3.0, 0.0, 0.0]))
    start, lost, left = plant.energy(), [], []
    for _ in range(200):
        before = plant.state
        plant.step(np.zeros(3))
        left.append(start - plant.energy())
        lost.append(friction * abs(plant.state.q[0] - before.q[0]))
    np.testing.assert_allclose(left[-1], np.sum(lost), rtol=0.02)


@pytest.mark.parametrize("damping", [1.0, 1e3, 1e6])
def test_damping_of_any_stiffness_decays_without_oscillating(damping):
    robot = load_robot("arm3dof", overrides={f"joint{i}.damping": damping for i in (1, 2, 3)})
    plant = PinocchioPlant(robot)
    plant.reset(at([0.0, 0.5, 0.5], [1.0, 1.0, 1.0]))
    speeds = [np.abs(plant.step(robot.gravity([0.0, 0.5, 0.5])).v).max() for _ in range(200)]
    assert speeds[-1] < 0.05
    assert max(speeds) < 1.1  # the joints are coupled: the fastest may gain a little at first


def test_bad_inputs_are_refused():
    robot = load_robot("arm3dof")
    for dt in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="dt is"):
            PinocchioPlant(robot, dt=dt)
    plant = PinocchioPlant(robot)
    with pytest.raises(InputError, match="finite"):
        plant.reset(at([np.nan, 0, 0]))
    with pytest.raises(InputError, match="needs 3"):
        plant.reset(JointState(0.0, np.zeros(2), np.zeros(2)))
    with pytest.raises(InputError, match="tau"):
        plant.step([np.nan, 0, 0])
    with pytest.raises(InputError, match="tau has shape"):
        plant.step([0.0])


def test_a_plant_starts_at_rest_inside_the_joint_range():
    for name in ("arm3dof", "ur5"):
        robot = load_robot(name)
        state = PinocchioPlant(robot).state
        assert (state.q >= robot.limits.q_min).all()
        assert (state.q <= robot.limits.q_max).all()
        np.testing.assert_array_equal(state.v, 0.0)


def test_end_stops_are_never_passed_and_take_energy_only():
    robot = load_robot("arm3dof")
    rng = np.random.default_rng(5)
    plant, free = PinocchioPlant(robot, end_stops=True), PinocchioPlant(robot)
    touched = 0
    for _ in range(10):
        start = at(robot.random_configuration(rng), 4 * rng.normal(size=3))
        plant.reset(start)
        for step in range(400):
            if step % 100 == 0:
                tau = robot.limits.tau_max * rng.uniform(-1, 1, 3)
            free.reset(plant.state)
            state, unstopped = plant.step(tau), free.step(tau)
            assert (state.q >= robot.limits.q_min).all()
            assert (state.q <= robot.limits.q_max).all()
            if not np.array_equal(state.v, unstopped.v):
                touched += 1
                mass = robot.mass_matrix(unstopped.q)
                before, after = (v @ mass @ v for v in (unstopped.v, state.v))
                assert after <= before + 1e-2 * max(before, 1e-3)
            else:
                np.testing.assert_array_equal(state.q, unstopped.q)
    assert touched > 100


def test_a_joint_outside_its_stops_can_only_come_back():
    robot = load_robot("arm3dof")
    plant = PinocchioPlant(robot, end_stops=True)
    start = np.array([robot.limits.q_max[0] + 0.2, 0.5, 0.5])
    plant.reset(at(start))
    outward = plant.step([1.0, *robot.gravity(start)[1:]])
    assert outward.q[0] == start[0]
    assert outward.v[0] == pytest.approx(0.0, abs=1e-9)
    for _ in range(300):
        inward = plant.step([-0.05, *robot.gravity(start)[1:]])
    assert inward.q[0] < start[0]
