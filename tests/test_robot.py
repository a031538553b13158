"""Dynamics and kinematics of a robot, against finite differences and against each other."""

import threading

import numpy as np
import pytest
from urdfs import FINGERS, GOOD

from arm3dof.errors import FrameNotFound, InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Description, Limits, Robot

STEP = 1e-6


@pytest.fixture(scope="module", params=["small", "arm3dof", "ur5", "z1", "so100"])
def robot(request) -> Robot:
    if request.param == "small":
        return robot_from_description(Description("small", GOOD, locked_joints=FINGERS))
    return load_robot(request.param)


def states(robot: Robot, count: int):
    rng = np.random.default_rng(11)
    for _ in range(count):
        yield robot.random_configuration(rng), *rng.normal(size=(2, robot.nv))


def directions(robot: Robot):
    yield from enumerate(STEP * np.eye(robot.nv))


def potential_energy(robot: Robot, q: np.ndarray) -> float:
    """Return -sum m g . c, with centres of mass from the frames alone."""
    energy = 0.0
    for index in range(1, robot.model.njoints):
        inertia = robot.model.inertias[index]
        centre = robot.placement(q, robot.model.names[index]).act(inertia.lever)
        energy -= inertia.mass * robot.gravity_acceleration @ centre
    return energy


def test_inverse_dynamics_undoes_forward_dynamics_with_friction(robot):
    for q, v, tau in states(robot, 50):
        acceleration = robot.forward_dynamics(q, v, tau)
        scale = max(1.0, np.abs(acceleration).max())
        np.testing.assert_allclose(
            robot.inverse_dynamics(q, v, acceleration), tau, atol=1e-9 * scale
        )


def test_inverse_dynamics_is_the_sum_of_its_terms(robot):
    for q, v, a in states(robot, 20):
        total = robot.mass_matrix(q) @ a + robot.coriolis(q, v) @ v + robot.gravity(q)
        total += robot.damping * v + robot.friction * np.sign(v)
        np.testing.assert_allclose(robot.inverse_dynamics(q, v, a), total, atol=1e-10)


def test_mass_matrix_is_symmetric_and_positive(robot):
    for q, _, _ in states(robot, 20):
        mass = robot.mass_matrix(q)
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass)[0] > 0


def test_coriolis_is_the_christoffel_matrix(robot):
    for q, v, _ in states(robot, 5):
        slope = np.array(
            [
                (robot.mass_matrix(q + d) - robot.mass_matrix(q - d)) / (2 * STEP)
                for _, d in directions(robot)
            ]
        )  # slope[k, i, j] = dM_ij / dq_k
        expected = 0.5 * (
            np.einsum("kij,k->ij", slope, v)
            + np.einsum("jik,k->ij", slope, v)
            - np.einsum("ijk,k->ij", slope, v)
        )
        coriolis = robot.coriolis(q, v)
        scale = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(coriolis, expected, atol=1e-8 * scale)
        rate = np.einsum("kij,k->ij", slope, v) - 2 * coriolis
        np.testing.assert_allclose(rate, -rate.T, atol=1e-8 * scale)


def test_gravity_is_the_slope_of_potential_energy(robot):
    for q, _, _ in states(robot, 5):
        slope = [
            (potential_energy(robot, q + d) - potential_energy(robot, q - d)) / (2 * STEP)
            for _, d in directions(robot)
        ]
        np.testing.assert_allclose(robot.gravity(q), slope, atol=2e-7)


def test_jacobian_is_the_slope_of_placement(robot):
    for q, _, _ in states(robot, 5):
        jacobian = robot.jacobian(q)
        pose = robot.placement(q)
        for column, d in directions(robot):
            ahead, behind = robot.placement(q + d), robot.placement(q - d)
            linear = (ahead.translation - behind.translation) / (2 * STEP)
            spin = (ahead.rotation - behind.rotation) / (2 * STEP) @ pose.rotation.T
            angular = [spin[2, 1], spin[0, 2], spin[1, 0]]
            np.testing.assert_allclose(jacobian[:3, column], linear, atol=1e-8)
            np.testing.assert_allclose(jacobian[3:, column], angular, atol=1e-8)


def test_random_configurations_fill_the_limits(robot):
    rng = np.random.default_rng(0)
    samples = np.array([robot.random_configuration(rng) for _ in range(500)])
    low = np.where(np.isfinite(robot.limits.q_min), robot.limits.q_min, -np.pi)
    high = np.where(np.isfinite(robot.limits.q_max), robot.limits.q_max, np.pi)
    assert (samples >= low).all()
    assert (samples <= high).all()
    assert (np.ptp(samples, axis=0) > 0.9 * (high - low)).all()


def test_results_are_copies(robot):
    q = robot.random_configuration(np.random.default_rng(0))
    zero = np.zeros(robot.nv)
    calls = (
        lambda: robot.mass_matrix(q),
        lambda: robot.coriolis(q, zero + 1),
        lambda: robot.gravity(q),
        lambda: robot.forward_dynamics(q, zero, zero),
        lambda: robot.inverse_dynamics(q, zero, zero),
        lambda: robot.jacobian(q),
        lambda: robot.placement(q).homogeneous,
        lambda: robot.gravity_acceleration,
    )
    for call in calls:
        first = call()
        kept = first.copy()
        first[...] = 7.0
        np.testing.assert_array_equal(call(), kept)


def test_a_clone_is_independent(robot):
    clone = robot.clone()
    assert clone.model is not robot.model
    assert clone.joint_names == robot.joint_names
    assert clone.description is robot.description
    clone.model.gravity.linear = np.zeros(3)
    q = robot.random_configuration(np.random.default_rng(5))
    np.testing.assert_array_equal(clone.gravity(q), np.zeros(robot.nv))
    assert np.abs(robot.gravity(q)).max() > 0


def test_reweighing_changes_the_dynamics_of_one_robot_alone(robot):
    own = robot.clone()
    lighter = [body.copy() for body in own.bodies]
    for body in lighter:
        body.mass *= 0.5
        body.inertia *= 0.5
    own.reweigh(lighter)
    q = np.linspace(0.1, 0.3, robot.nv)
    rotors = np.diag(robot.model.armature)
    expected = 0.5 * (robot.mass_matrix(q) - rotors) + rotors
    np.testing.assert_allclose(own.mass_matrix(q), expected, atol=1e-12)
    np.testing.assert_allclose(own.gravity(q), 0.5 * robot.gravity(q), atol=1e-12)
    with pytest.raises(InputError, match=f"{robot.nv - 1} entries; .* has {robot.nv} joints"):
        own.reweigh(lighter[1:])
    np.testing.assert_allclose(own.mass_matrix(q), expected, atol=1e-12)


def test_clones_work_in_threads():
    robot = load_robot()
    rng = np.random.default_rng(6)
    samples = [robot.random_configuration(rng) for _ in range(300)]
    expected = [robot.mass_matrix(q) for q in samples]
    results: list[list[np.ndarray]] = [[], []]

    def work(own: Robot, found: list[np.ndarray]) -> None:
        found.extend(own.mass_matrix(q) for q in samples)

    threads = [threading.Thread(target=work, args=(robot.clone(), found)) for found in results]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for found in results:
        np.testing.assert_array_equal(found, expected)


def test_wrong_shapes_and_frames(robot):
    good, bad = np.zeros(robot.nv), np.zeros(robot.nv + 1)
    for call in (
        lambda: robot.mass_matrix(bad),
        lambda: robot.coriolis(good, bad),
        lambda: robot.gravity([[0.0]]),
        lambda: robot.inverse_dynamics(good, good, bad),
        lambda: robot.forward_dynamics(good, bad, good),
        lambda: robot.friction_torque("fast"),
        lambda: robot.placement(bad),
    ):
        with pytest.raises(InputError, match="; give "):
            call()
    for method in (robot.placement, robot.jacobian):
        with pytest.raises(FrameNotFound, match="no frame 'hand2'; this robot has: universe"):
            method(good, "hand2")


def test_names(robot):
    assert set(robot.joint_names) <= set(robot.frame_names)
    assert len(set(robot.frame_names)) == len(robot.frame_names)
    assert robot.tool_frame in repr(robot)


def test_friction_opposes_motion():
    robot = robot_from_description(Description("small", GOOD, locked_joints=FINGERS))
    np.testing.assert_allclose(robot.friction_torque([2.0, -3.0, 0.0]), [0.5, -0.05, 0.0])
    np.testing.assert_allclose(robot.friction_torque([0.0, 0.0, -1.0]), [0.0, 0.0, -1.0])


def test_limits_are_frozen_and_of_one_length():
    limits = Limits(*np.ones((4, 3)))
    with pytest.raises(ValueError, match="read-only"):
        limits.q_min[0] = 0.0
    with pytest.raises(InputError, match=r"tau_max has shape \(2,\); give shape \(3\)"):
        Limits(np.ones(3), np.ones(3), np.ones(3), np.ones(2))


def test_a_description_is_frozen():
    locked = {"finger": 0.0}
    description = Description("x", GOOD, locked_joints=locked)
    locked["finger"] = 1.0
    assert description.locked_joints["finger"] == 0.0
    with pytest.raises(TypeError):
        description.locked_joints["finger"] = 1.0
