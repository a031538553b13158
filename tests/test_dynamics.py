import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arm_family import random_arm
from numpy.testing import assert_allclose

from arm3dof.errors import InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.dh import DhMisfit, link_transforms
from arm3dof.model.dynamics import ClosedForm
from arm3dof.model.robot import Description

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = (ROOT / "urdf" / "arm3dof.urdf").read_text(encoding="utf-8")


def reference(gravity=(0.0, 0.0, -9.81), locked=()):
    locked = {"gripper": 0.0, "left_finger_joint": 0.0, **dict(locked)}
    description = Description("arm3dof", REFERENCE, locked_joints=locked, gravity=gravity)
    return robot_from_description(description, "tool")


def states(rng, count):
    return rng.uniform(-np.pi, np.pi, (count, 3)), rng.uniform(-8.0, 8.0, (count, 3))


def relative_error(ours, theirs, floor):
    """Return the largest difference of a state over the largest number of that state.

    Where the parts of a torque cancel, both engines are left with round-off of the parts: a state
    whose numbers are below ``floor`` times the median is measured against that.
    """
    axes = tuple(range(1, ours.ndim))
    sizes = np.abs(theirs).max(axes)
    return np.max(np.abs(ours - theirs).max(axes) / np.maximum(sizes, floor * np.median(sizes)))


def worst_errors(arm_count, state_count, seed, floor=0.01):
    """Return the worst relative errors of M, N, N v and g over random arms and states."""
    worst = np.zeros(4)
    for index in range(arm_count):
        rng = np.random.default_rng([seed, index])
        gravity = (9.8, 9.81)[index % 2]
        robot = random_arm(rng, upright=index % 4 < 3, gravity=gravity).robot
        closed = ClosedForm.from_robot(robot)
        q, v = states(rng, state_count)
        n_ours = closed.coriolis(q, v)
        n_theirs = np.array([robot.coriolis(a, b) for a, b in zip(q, v, strict=True)])
        pairs = [
            (closed.mass_matrix(q), np.array([robot.mass_matrix(a) for a in q])),
            (n_ours, n_theirs),
            (np.einsum("nij,nj->ni", n_ours, v), np.einsum("nij,nj->ni", n_theirs, v)),
            (closed.gravity(q), np.array([robot.gravity(a) for a in q])),
        ]
        worst = np.maximum(worst, [relative_error(*pair, floor) for pair in pairs])
    return worst


def test_closed_form_equals_pinocchio():
    assert np.all(worst_errors(arm_count=200, state_count=50, seed=1) <= 1e-12)


@pytest.mark.slow
def test_closed_form_equals_pinocchio_in_many_more_states():
    worst = worst_errors(arm_count=200, state_count=2_000, seed=2, floor=0.05)
    assert np.all(worst <= 1e-12)


@pytest.mark.parametrize("gravity", [9.8, 9.81])
def test_closed_form_of_the_reference_arm_equals_pinocchio(gravity):
    robot = reference(gravity=(0.0, 0.0, -gravity))
    closed = ClosedForm.from_robot(robot)
    assert closed.g0 == gravity
    for q, v in zip(*states(np.random.default_rng(3), 500), strict=True):
        for ours, theirs in (
            (closed.mass_matrix(q), robot.mass_matrix(q)),
            (closed.coriolis(q, v), robot.coriolis(q, v)),
            (closed.gravity(q), robot.gravity(q)),
        ):
            assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize("seed", range(20))
def test_rate_of_mass_matrix_less_twice_coriolis_is_skew(seed):
    rng = np.random.default_rng([4, seed])
    closed = ClosedForm.from_robot(random_arm(rng, upright=True).robot)
    q, v = states(rng, 50)
    h = 1e-4  # five points of M along v: an error of order h^4
    m = {k: closed.mass_matrix(q + k * h * v / 8.0) for k in (-2, -1, 1, 2)}
    rate = (m[-2] - 8.0 * m[-1] + 8.0 * m[1] - m[2]) / (12.0 * h / 8.0)
    skew = rate - 2.0 * closed.coriolis(q, v)
    assert np.abs(skew + np.swapaxes(skew, -1, -2)).max() < 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_mass_matrix_is_symmetric_positive_definite(seed):
    rng = np.random.default_rng([5, seed])
    closed = ClosedForm.from_robot(random_arm(rng, upright=False).robot)
    m = closed.mass_matrix(states(rng, 500)[0])
    assert np.array_equal(m, np.swapaxes(m, -1, -2))
    assert np.linalg.eigvalsh(m).min() > 0.0


@pytest.mark.parametrize("seed", range(20))
def test_gravity_is_the_slope_of_the_potential_energy(seed):
    rng = np.random.default_rng([6, seed])
    robot = random_arm(rng, upright=False).robot
    closed = ClosedForm.from_robot(robot)
    frame = closed.geometry.transform_base_dh[:3, :3]
    assert_allclose(frame @ closed.gravity_acceleration, robot.gravity_acceleration, atol=1e-14)
    q, step = states(rng, 1)[0][0], 1e-4 * np.eye(3)
    work = [[potential(closed, q + k * e) for k in (-2, -1, 1, 2)] for e in step]
    slope = [(a - 8.0 * b + 8.0 * c - d) / 12e-4 for a, b, c, d in work]
    assert_allclose(closed.gravity(q), slope, atol=1e-9)


def potential(closed, q):
    """Return the potential energy from the paper's link parameters and (4)."""
    moves = link_transforms(closed.geometry.to_dh(q), closed.a2, closed.a3)
    far_moves = [np.eye(4), moves[2], moves[3]]  # to the frame that holds the centroid
    frame, energy = np.eye(4), 0.0
    for mass, centroid, move, far in zip(
        closed.masses, closed.centroids, moves[:3], far_moves, strict=True
    ):
        frame = frame @ move
        shift = np.append(far[:3, 3] + centroid, 1.0)
        energy -= mass * closed.gravity_acceleration @ (frame @ shift)[:3]
    return energy


def test_gravity_is_what_the_paper_prints():
    robot = reference(gravity=(0.0, 0.0, -9.8))
    arm = ClosedForm.from_robot(robot)
    (_, m2, m3), a2, a3, g0 = arm.masses, arm.a2, arm.a3, arm.g0
    (x2, y2, _), (x3, y3, _) = arm.centroids[1:]
    for q in states(np.random.default_rng(7), 100)[0]:
        c2, s2 = np.cos(q[1]), np.sin(q[1])
        c23, s23 = np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
        printed = [
            0.0,
            g0 * (m3 * (a2 * c2 + (a3 + x3) * c23 - y3 * s23) + m2 * ((a2 + x2) * c2 - y2 * s2)),
            m3 * g0 * ((a3 + x3) * c23 - y3 * s23),
        ]
        assert_allclose(arm.gravity(q), printed, atol=1e-15)


def test_link_parameters_are_those_of_the_urdf():
    robot = reference()
    arm = ClosedForm.from_robot(robot)
    far_ends = np.array([[0.0, 0, 0], [0.105, 0, 0], [0.150, 0, 0]])
    for i, inertia in enumerate(robot.model.inertias[1:]):
        assert arm.masses[i] == inertia.mass
        assert_allclose(arm.centroids[i] + far_ends[i], inertia.lever, atol=1e-15)
        assert_allclose(arm.tensors[i], inertia.inertia, atol=1e-18)
    assert_allclose([arm.a2, arm.a3], [0.105, 0.150], rtol=1e-15)


def test_a_changed_parameter_changes_the_answer():
    arm = ClosedForm.from_robot(reference())
    heavier = replace(arm, masses=arm.masses * 2.0)
    q = np.array([0.1, 0.2, 0.3])
    assert_allclose(heavier.gravity(q), 2.0 * arm.gravity(q), rtol=1e-14)


def test_batches_are_the_single_answers():
    arm = ClosedForm.from_robot(reference())
    q, v = (part.reshape(4, 5, 3) for part in states(np.random.default_rng(8), 20))
    m, n, g = arm.mass_matrix(q), arm.coriolis(q, v), arm.gravity(q)
    assert m.shape == n.shape == (4, 5, 3, 3)
    assert g.shape == (4, 5, 3)
    for index in np.ndindex(4, 5):
        assert_allclose(m[index], arm.mass_matrix(q[index]), rtol=1e-14)
        assert_allclose(n[index], arm.coriolis(q[index], v[index]), rtol=1e-12, atol=1e-18)
        assert_allclose(g[index], arm.gravity(q[index]), rtol=1e-13, atol=1e-16)


def test_empty_batches_give_empty_results():
    arm, none = ClosedForm.from_robot(reference()), np.empty((0, 3))
    assert arm.mass_matrix(none).shape == (0, 3, 3)
    assert arm.coriolis(none, none).shape == (0, 3, 3)
    assert arm.gravity(none).shape == (0, 3)


def test_wrong_shapes_are_refused():
    arm = ClosedForm.from_robot(reference())
    with pytest.raises(InputError, match="joint angles have shape"):
        arm.mass_matrix([0.0, 1.0])
    with pytest.raises(InputError, match=r"v has shape \(2,\)"):
        arm.coriolis(np.zeros(3), np.zeros(2))
    with pytest.raises(InputError, match="masses has shape"):
        replace(arm, masses=np.ones(2))


def test_link_parameters_are_frozen():
    arm = ClosedForm.from_robot(reference())
    for array in (arm.masses, arm.centroids, arm.tensors, arm.gravity_acceleration):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_robot_of_another_kind_is_refused():
    with pytest.raises(DhMisfit, match="2 moving joints"):
        ClosedForm.from_robot(reference(locked={"joint3": 0.2}))


# ---- the derivation ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def derivation():
    """Return the script and the lines that it derives (the derivation takes seconds)."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools"))
        script = importlib.import_module("derive_closed_form")
    return script, script.derive()


@pytest.mark.slow
def test_the_terms_are_what_the_derivation_gives(derivation, monkeypatch):
    script, lines = derivation
    monkeypatch.setattr(script, "derive", lambda: lines)
    assert script.main(["--check"]) == 0


@pytest.mark.slow
def test_terms_that_were_edited_are_found(derivation, monkeypatch, tmp_path, capsys):
    script, lines = derivation
    monkeypatch.setattr(script, "derive", lambda: lines)
    monkeypatch.setattr(script, "prove", lambda *_: None)
    monkeypatch.setattr(script, "MODULE", tmp_path / "terms.py")
    assert script.main(["--check"]) == 1
    assert "run it" in capsys.readouterr().err
    assert script.main([]) == 0
    assert script.main(["--check"]) == 0
    (tmp_path / "terms.py").write_text("M = 0", encoding="utf-8")
    assert script.main(["--check"]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(("listing", "name"), [(0, "m12"), (1, "n13"), (2, "g2_link2")])
def test_a_wrong_term_is_not_proved(derivation, listing, name):
    script, lines = derivation
    wrong = [list(part) for part in lines]
    index = next(i for i, line in enumerate(wrong[listing]) if line[0] == name)
    wrong[listing][index] = (name, f"2.0 * ({wrong[listing][index][1]})")
    with pytest.raises(ArithmeticError, match="do not satisfy Lagrange"):
        script.prove(*wrong)
