"""Closed-form inverse kinematics: every branch, every reason, every border."""

import subprocess
import sys

import numpy as np
import pytest
from arm_family import pose, random_arm, random_rotation
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import leastsq, minimize

from arm3dof.errors import InputError
from arm3dof.model.dh import DhGeometry, fit_dh
from arm3dof.model.kinematics import Reason, Singularity, closed_form_reach, inverse_kinematics
from arm3dof.model.library import load_robot
from arm3dof.model.planar_ik import BRANCHES, CHUNK, solve_points
from arm3dof.model.robot import Limits
from arm3dof.model.turns import closest_inside, into_limits

NAMES = ("base", "shoulder", "elbow")
FREE = (np.full(3, -np.inf), np.full(3, np.inf))


def random_geometry(rng):
    a2, a3 = rng.uniform(0.05, 0.6, 2)
    place = pose(random_rotation(rng), rng.uniform(-0.5, 0.5, 3))
    return DhGeometry(place, a2, a3, rng.choice([-1.0, 1.0], 3), rng.uniform(-np.pi, np.pi, 3))


def plain_geometry(a2=0.105, a3=0.150):
    return DhGeometry(np.eye(4), a2, a3, np.ones(3), np.zeros(3))


def limits(low, high):
    return Limits(low, high, np.full(3, 7.5), np.full(3, 2.0))


def random_limits(rng):
    centre, half = rng.uniform(-2, 2, 3), rng.uniform(0.1, 2.0, 3)
    return limits(centre - half, centre + half)


def reach(geometry, p, low=FREE[0], high=FREE[1], near=None):
    return closed_form_reach(geometry, limits(low, high), NAMES, np.array(p, dtype=float), near)


def apart(q, other):
    """Return the greatest angle between two postures, the short way round."""
    return np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


@pytest.fixture(scope="module")
def robot():
    return load_robot()


# ---- every branch, for many points ---------------------------------------------------------------


def test_every_branch_reaches_its_point_on_100000_points():
    rng = np.random.default_rng(0)
    for _ in range(20):
        geometry = random_geometry(rng)
        q = rng.uniform(-np.pi, np.pi, (5000, 3))
        points = geometry.tool_position(q)
        found = solve_points(geometry, points)
        assert found.exists.all()
        miss = np.linalg.norm(geometry.tool_position(found.q) - points[:, None], axis=2)
        assert miss.max() <= 1e-9
        assert (found.q > -np.pi).all()
        assert (found.q <= np.pi).all()
        # the posture that the point was made with is one of the branches; near a border the same
        # rounding of the point is a greater one of the elbow
        assert np.median(apart(found.q, q[:, None]).min(axis=1)) < 1e-13
        assert apart(found.q, q[:, None]).min(axis=1).max() < 1e-4


def test_pinocchio_agrees_on_every_branch(robot):
    rng = np.random.default_rng(1)
    for arm in [robot, *(random_arm(rng, upright=False).robot for _ in range(5))]:
        for _ in range(60):
            q = rng.uniform(-np.pi, np.pi, 3)
            p = arm.placement(q).translation
            answer = inverse_kinematics(arm, p)
            assert len(answer.branches) == 4
            assert apart(answer.solutions, q).min() < 1e-7
            for solution in answer.solutions:
                assert_allclose(arm.placement(solution).translation, p, atol=1e-9)


@pytest.mark.slow
def test_pinocchio_agrees_on_every_branch_of_100000_points(robot):
    rng = np.random.default_rng(13)
    geometry = fit_dh(robot)
    points = geometry.tool_position(rng.uniform(-np.pi, np.pi, (100_000, 3)))
    found = solve_points(geometry, points)
    assert found.exists.all()
    worst = max(
        np.abs(robot.placement(q).translation - p).max()
        for p, branches in zip(points, found.q, strict=True)
        for q in branches
    )
    assert worst <= 1e-9


def search(geometry, p, rng, starts):
    """Return the roots of FK(q) = p that a numerical search finds."""
    roots = []
    for start in rng.uniform(-np.pi, np.pi, (starts, 3)):
        root, *_ = leastsq(lambda q: geometry.tool_position(q) - p, start, xtol=1e-14, ftol=1e-14)
        if np.linalg.norm(geometry.tool_position(root) - p) < 1e-12:
            roots.append(root)
    return np.array(roots)


def check_no_branch_is_lost(targets, starts):
    rng = np.random.default_rng(2)
    seen = set()
    for _ in range(targets):
        geometry = random_geometry(rng)
        p = geometry.tool_position(rng.uniform(-np.pi, np.pi, 3))
        answer = reach(geometry, p)
        assert len(answer.branches) == 4
        roots = search(geometry, p, rng, starts)
        distances = apart(roots[:, None], answer.solutions)
        assert distances.min(axis=1).max() < 1e-5
        seen.update(answer.branches[row] for row in distances.argmin(axis=1))
    assert seen == set(BRANCHES)


def test_no_branch_is_lost():
    check_no_branch_is_lost(targets=25, starts=20)


@pytest.mark.slow
def test_no_branch_is_lost_on_100_targets():
    check_no_branch_is_lost(targets=100, starts=40)


def test_branch_names_say_where_the_elbow_is():
    rng = np.random.default_rng(3)
    geometry = plain_geometry()
    for _ in range(200):
        p = geometry.tool_position(rng.uniform(-np.pi, np.pi, 3))
        answer = reach(geometry, p)
        assert answer.branches == BRANCHES
        for name, q in zip(answer.branches, answer.solutions, strict=True):
            ahead = np.array([np.cos(q[0]), np.sin(q[0]), 0.0])
            assert (ahead @ p > 0) == name.startswith("front")
            elbow = geometry.a2 * (np.cos(q[1]) * ahead + np.array([0, 0, np.sin(q[1])]))
            side = np.cross(p / np.linalg.norm(p), elbow)  # about the axis that lifts the target
            lift = np.cross(p, [0.0, 0.0, 1.0])
            assert (side @ lift > 0) == name.endswith("up")


# ---- many points at once -------------------------------------------------------------------------


def test_batch_is_the_same_in_any_chunk():
    rng = np.random.default_rng(4)
    geometry = random_geometry(rng)
    points = rng.uniform(-1, 1, (2 * CHUNK + 17, 3))
    whole = solve_points(geometry, points)
    for row in (0, CHUNK - 1, CHUNK, 2 * CHUNK, 2 * CHUNK + 16):
        alone = solve_points(geometry, points[row : row + 1])
        assert_allclose(alone.q[0], whole.q[row], atol=1e-13)
        assert alone.exists[0] == whole.exists[row]


def test_batch_says_which_points_are_out_of_reach():
    points = [[0.2, 0, 0], [0.3, 0, 0], [0.01, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0], [1e300, 0, 0]]
    found = solve_points(plain_geometry(), points)
    assert_array_equal(found.exists, [True, False, False, False, False, False])
    assert np.isfinite(found.q[0]).all()
    assert np.isnan(found.q[1:]).all()


def test_batch_of_nothing():
    found = solve_points(plain_geometry(), np.empty((0, 3)))
    assert found.q.shape == (0, 4, 3)
    assert found.exists.shape == (0,)


@pytest.mark.parametrize("points", [np.zeros(3), np.zeros((2, 4)), np.zeros((2, 3, 1))])
def test_batch_refuses_other_shapes(points):
    with pytest.raises(InputError, match="points has shape"):
        solve_points(plain_geometry(), points)


# ---- limits --------------------------------------------------------------------------------------


def test_limits_are_told_truly():
    rng = np.random.default_rng(5)
    for _ in range(300):
        geometry, box = random_geometry(rng), random_limits(rng)
        q = rng.uniform(box.q_min, box.q_max)
        p = geometry.tool_position(q)
        answer = closed_form_reach(geometry, box, NAMES, p)
        assert answer.reachable
        assert (answer.distance, answer.joint) == (0.0, None)
        assert_array_equal(answer.nearest, p)
        inside = ((answer.solutions >= box.q_min) & (answer.solutions <= box.q_max)).all(axis=1)
        assert_array_equal(answer.within_limits, inside)
        assert np.abs(answer.solutions[inside] - q).max(axis=1).min() < 1e-5
        assert_array_equal(answer.within_limits, np.sort(inside)[::-1])  # those inside come first
        assert_array_equal(answer.best, answer.solutions[0])
        assert_array_equal(answer.nearest_q, answer.best)


def test_a_solution_on_a_limit_is_inside():
    rng = np.random.default_rng(6)
    for _ in range(300):
        geometry, box = random_geometry(rng), random_limits(rng)
        corner = np.where(rng.random(3) < 0.5, box.q_min, box.q_max)
        answer = closed_form_reach(geometry, box, NAMES, geometry.tool_position(corner))
        assert answer.reachable
        inside = answer.solutions[answer.within_limits]
        assert (inside >= box.q_min).all()
        assert (inside <= box.q_max).all()
        assert np.abs(inside - corner).max(axis=1).min() < 1e-5


@pytest.mark.parametrize(
    ("low", "high"), [(3.0, 5.5), (-5.5, -3.0), (2.0 * np.pi, 8.0), (0.0, 6.2), (-9.0, 9.0)]
)
def test_whole_turns_bring_a_joint_inside(low, high):
    rng = np.random.default_rng(7)
    geometry = random_geometry(rng)
    box = np.full(3, low), np.full(3, high)
    for _ in range(50):
        q = rng.uniform(*box)
        answer = reach(geometry, geometry.tool_position(q), *box, near=q)
        assert_allclose(answer.best, q, atol=1e-6)
        assert (answer.best >= low).all()
        assert (answer.best <= high).all()


def test_without_limits_angles_are_within_half_a_turn():
    rng = np.random.default_rng(8)
    geometry = random_geometry(rng)
    for _ in range(50):
        p = geometry.tool_position(rng.uniform(-9, 9, 3))
        solutions = reach(geometry, p).solutions
        assert (solutions > -np.pi).all()
        assert (solutions <= np.pi).all()
        near = rng.uniform(-50, 50, 3)
        assert np.abs(reach(geometry, p, near=near).solutions - near).max() <= np.pi + 1e-12


def test_near_ranks_the_solutions():
    rng = np.random.default_rng(9)
    for _ in range(100):
        geometry, near = random_geometry(rng), rng.uniform(-3, 3, 3)
        p = geometry.tool_position(rng.uniform(-3, 3, 3))
        answer = reach(geometry, p, near=near)
        assert sorted(answer.branches) == sorted(BRANCHES)
        distances = np.linalg.norm(answer.solutions - near, axis=1)
        assert_array_equal(distances, np.sort(distances))


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_the_joint_at_fault_is_named(robot, joint, side):
    q = np.array([0.3, 0.6, 0.9])
    q[joint] = 0.0
    low, high = q - 0.2, q + 0.2
    q[joint] += side * 0.35
    geometry = fit_dh(robot)
    answer = reach(geometry, geometry.tool_position(q), low, high)
    assert answer.reason is Reason.OUTSIDE_LIMITS
    assert answer.joint == NAMES[joint]
    assert answer.best is None
    assert not answer.within_limits.any()
    assert answer.branches
    assert NAMES[joint] in answer.sentence


# ---- out of reach --------------------------------------------------------------------------------


def test_too_far(robot):
    answer = inverse_kinematics(robot, [0.3, 0.1, 0.0])
    assert answer.reason is Reason.TOO_FAR
    assert (answer.branches, answer.best, answer.joint) == ((), None, None)
    assert answer.solutions.shape == (0, 3)
    geometry = fit_dh(robot)
    border = geometry.a2 + geometry.a3
    assert_allclose(answer.distance, np.hypot(0.3, 0.1) - border, atol=1e-12)
    assert_allclose(answer.nearest, border * np.array([3, 1, 0]) / np.sqrt(10), atol=1e-12)
    assert "farther away than the arm reaches" in answer.sentence


def test_too_near():
    geometry = plain_geometry()
    answer = reach(geometry, [0.0, 0.02, 0.0])
    assert answer.reason is Reason.TOO_NEAR
    assert_allclose(answer.distance, 0.045 - 0.02, atol=1e-12)
    assert_allclose(answer.nearest, [0, 0.045, 0], atol=1e-12)


@pytest.mark.parametrize("far", [1e3, 1e9, 1e300])
def test_absurdly_far_targets_still_have_an_answer(robot, far):
    geometry = fit_dh(robot)
    answer = inverse_kinematics(robot, [far, 0.0, 0.0])
    assert answer.reason is Reason.TOO_FAR
    assert_allclose(answer.nearest, [geometry.a2 + geometry.a3, 0, 0], atol=1e-6)
    assert_allclose(answer.distance, far, rtol=1e-3)


def check_nearest(rng, geometry, box, p):
    answer = closed_form_reach(geometry, box, NAMES, p)
    q = answer.nearest_q
    assert (q >= box.q_min).all()
    assert (q <= box.q_max).all()
    assert_allclose(geometry.tool_position(q), answer.nearest, atol=1e-9)
    # no configuration of a dense sample is nearer, nor is what a minimiser makes of the best ones
    sample = rng.uniform(box.q_min, box.q_max, (20000, 3))
    distances = np.linalg.norm(geometry.tool_position(sample) - p, axis=1)
    best = distances.min()
    assert answer.distance <= best
    for start in sample[np.argsort(distances)[:2]]:
        result = minimize(
            lambda q: np.sum((geometry.tool_position(q) - p) ** 2),
            start,
            bounds=list(zip(box.q_min, box.q_max, strict=True)),
            method="L-BFGS-B",
        )
        best = min(best, np.sqrt(result.fun))
    assert answer.distance <= best + 1e-9
    assert best - answer.distance < 1e-3
    # going there is possible
    again = closed_form_reach(geometry, box, NAMES, answer.nearest)
    assert again.distance < 1e-9
    distance = np.linalg.norm(p - geometry.transform_base_dh[:3, 3])
    assert (answer.reason is Reason.TOO_FAR) == (distance > geometry.a2 + geometry.a3)
    assert (answer.reason is Reason.TOO_NEAR) == (distance < abs(geometry.a2 - geometry.a3))
    return answer.reason


def test_nearest_is_really_the_nearest():
    rng = np.random.default_rng(10)
    seen = set()
    for _ in range(60):
        geometry, box = random_geometry(rng), random_limits(rng)
        span = geometry.a2 + geometry.a3
        centre = geometry.transform_base_dh[:3, 3]
        seen.add(check_nearest(rng, geometry, box, centre + rng.uniform(-span, span, 3)))
    for _ in range(10):  # in the hollow around the shoulder
        geometry, box = random_geometry(rng), random_limits(rng)
        inner = abs(geometry.a2 - geometry.a3)
        centre = geometry.transform_base_dh[:3, 3]
        seen.add(check_nearest(rng, geometry, box, centre + rng.uniform(-inner, inner, 3) / 2))
    assert seen >= set(Reason)


def test_nearest_with_one_sided_and_missing_limits():
    low, high = np.array([-np.inf, 0.1, -np.inf]), np.array([0.3, np.inf, np.inf])
    geometry = plain_geometry()
    answer = reach(geometry, [0.0, 0.5, 0.0], low, high)
    assert answer.reason is Reason.TOO_FAR
    assert_allclose(answer.nearest, [0, 0.255, 0], atol=1e-12)
    assert (answer.nearest_q >= low).all()
    assert (answer.nearest_q <= high).all()


# ---- singular targets ----------------------------------------------------------------------------


def check_solutions(geometry, p, answer):
    assert len(answer.branches) == len(answer.solutions)
    for q in answer.solutions:
        assert_allclose(geometry.tool_position(q), p, atol=1e-9)


def test_above_the_base_the_first_joint_is_free():
    geometry = plain_geometry()
    p = np.array([0.0, 0.0, 0.2])
    answer = reach(geometry, p)
    assert answer.singularities == (Singularity.BASE_FREE,)
    assert answer.free_joints == ("base",)
    assert answer.branches == ("front/elbow-up", "front/elbow-down")
    assert_array_equal(answer.solutions[:, 0], 0.0)
    check_solutions(geometry, p, answer)
    turned = reach(geometry, p, near=np.array([1.2, 0.0, 0.0]))
    assert_array_equal(turned.solutions[:, 0], 1.2)
    check_solutions(geometry, p, turned)
    limited = reach(geometry, p, np.array([0.5, -4, -4]), np.array([1, 4, 4]))
    assert limited.reachable
    assert_array_equal(limited.solutions[:, 0], 0.5)


def test_straight_up_all_branches_are_one():
    geometry = plain_geometry()
    p = np.array([0.0, 0.0, 0.255])
    answer = reach(geometry, p)
    assert answer.singularities == (Singularity.BASE_FREE, Singularity.STRETCHED)
    assert answer.branches == ("front/elbow-straight",)
    assert_allclose(answer.solutions, [[0, np.pi / 2, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("radius", "kind", "name", "elbow"),
    [
        (0.255, Singularity.STRETCHED, "elbow-straight", 0.0),
        (0.045, Singularity.FOLDED, "elbow-folded", np.pi),
    ],
)
def test_on_the_border_both_elbows_are_one(radius, kind, name, elbow):
    geometry = plain_geometry()
    rng = np.random.default_rng(11)
    for _ in range(50):
        direction = rng.normal(size=3)
        p = radius * direction / np.linalg.norm(direction)
        answer = reach(geometry, p)
        assert answer.singularities == (kind,)
        assert answer.free_joints == ()
        assert answer.branches == (f"front/{name}", f"back/{name}")
        assert_allclose(np.abs(answer.solutions[:, 2]), elbow, atol=1e-12)
        check_solutions(geometry, p, answer)


def test_just_beside_the_border_there_are_still_four():
    geometry = plain_geometry()
    for radius in (0.255 - 1e-9, 0.045 + 1e-9):
        p = radius * np.array([0.6, 0.0, 0.8])
        answer = reach(geometry, p)
        assert len(answer.branches) == 4
        check_solutions(geometry, p, answer)
    assert reach(geometry, [0.255 + 1e-9, 0, 0]).reason is Reason.TOO_FAR
    assert reach(geometry, [0.045 - 1e-9, 0, 0]).reason is Reason.TOO_NEAR


def test_at_the_shoulder_of_equal_links_two_joints_are_free():
    geometry = plain_geometry(0.1, 0.1)
    for p in (np.zeros(3), np.array([1e-12, 0, -1e-12])):
        answer = reach(geometry, p)
        kinds = (Singularity.BASE_FREE, Singularity.SHOULDER_FREE, Singularity.FOLDED)
        assert answer.singularities == kinds
        assert answer.free_joints == ("base", "shoulder")
        assert answer.branches == ("front/elbow-folded",)
        assert_allclose(answer.solutions, [[0, 0, np.pi]], atol=1e-9)
        near = np.array([0.4, -0.7, 0.0])
        held = reach(geometry, p, near=near)
        assert_allclose(held.solutions, [[0.4, -0.7, np.pi]], atol=1e-9)
        check_solutions(geometry, p, held)


def test_a_limit_can_forbid_a_singular_target():
    geometry = plain_geometry()
    answer = reach(geometry, [0.255, 0, 0], np.array([-1, -1, 0.2]), np.array([1, 1, 2.0]))
    assert answer.reason is Reason.OUTSIDE_LIMITS
    assert answer.joint == "elbow"
    assert answer.singularities == (Singularity.STRETCHED,)
    bent = np.sqrt(0.105**2 + 0.15**2 + 2 * 0.105 * 0.15 * np.cos(0.2))
    assert_allclose(answer.distance, 0.255 - bent, atol=1e-12)


def test_near_singular_targets_keep_their_accuracy():
    rng = np.random.default_rng(12)
    geometry = plain_geometry(0.1, 0.1)
    for exponent in range(-12, -3):
        for _ in range(20):
            q = rng.uniform(-np.pi, np.pi, 3)
            q[2] = rng.choice([0.0, np.pi]) + 10.0**exponent
            if rng.random() < 0.5:  # close to the first joint's axis, too
                q[1] = np.pi / 2 - q[2] / 2 + 10.0**exponent
            p = geometry.tool_position(q)
            answer = reach(geometry, p)
            assert answer.reachable
            check_solutions(geometry, p, answer)


# ---- the front door ------------------------------------------------------------------------------


def test_near_is_used_by_the_front_door(robot):
    p = robot.placement([0.4, 1.2, -0.9]).translation
    answer = inverse_kinematics(robot, p, near=[0.4, 1.2, -0.9])
    assert_allclose(answer.best, [0.4, 1.2, -0.9], atol=1e-9)


@pytest.mark.parametrize(
    ("p", "message"),
    [
        ([np.nan, 0, 0], "p is .*nan.*; give finite numbers"),
        ([np.inf, 0, 0], "give finite numbers"),
        ([1, 2], r"p has shape \(2,\)"),
        ([[1, 2, 3]], "p has shape"),
        ("here", "give an array of numbers"),
    ],
)
def test_a_broken_target_is_refused(robot, p, message):
    with pytest.raises(InputError, match=message):
        inverse_kinematics(robot, p)


def test_a_broken_near_is_refused(robot):
    with pytest.raises(InputError, match="near has shape"):
        inverse_kinematics(robot, [0.1, 0.1, 0.1], near=[0, 0])
    with pytest.raises(InputError, match="near is"):
        inverse_kinematics(robot, [0.1, 0.1, 0.1], near=[0, np.nan, 0])


def test_the_answer_cannot_be_changed(robot):
    p = np.array([0.1, 0.1, 0.1])
    answer = inverse_kinematics(robot, p)
    p[0] = 9.0
    assert answer.target[0] == 0.1
    for array in (answer.solutions, answer.within_limits, answer.nearest, answer.nearest_q):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_reasons_and_singularities_speak():
    for kind in (*Reason, *Singularity):
        assert len(kind.sentence.split()) > 4
    assert f"{Reason.TOO_FAR}" == "too_far"


def test_sentence_counts_the_ways(robot):
    answer = inverse_kinematics(robot, robot.placement([0.1, 0.2, 0.3]).translation)
    count = int(answer.within_limits.sum())
    assert answer.sentence == f"the target is reached in {count} way{'s' * (count > 1)}"


def test_the_closed_form_needs_no_scipy():
    code = (
        "import sys; from arm3dof import inverse_kinematics, load_robot;"
        "inverse_kinematics(load_robot(), [0.1, 0.1, 0.1]);"
        "sys.exit(any(name.split('.')[0] in ('scipy', 'pink') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# ---- whole turns ---------------------------------------------------------------------------------


def test_into_limits_prefers_the_inside_then_the_reference():
    low, high = np.array([-7.0]), np.array([7.0])
    assert_allclose(into_limits(np.array([4.0]), low, high, np.zeros(1)), [4.0 - 2 * np.pi])
    assert_allclose(into_limits(np.array([4.0]), low, high, np.array([5.0])), [4.0])
    assert_allclose(into_limits(np.array([0.0]), low, high, np.array([50.0])), [2 * np.pi])
    assert_allclose(into_limits(np.array([3.0]), np.ones(1), 2 * np.ones(1), np.zeros(1)), [3.0])


def test_closest_inside_takes_the_short_way():
    assert closest_inside(0.5, -1.0, 1.0) == 0.5
    assert closest_inside(2.0, -1.0, 1.0) == 1.0
    assert closest_inside(-2.0, -1.0, 1.0) == -1.0
    assert closest_inside(np.pi + 0.1, -1.0, 1.5) == 1.5
    assert_allclose(closest_inside(0.5, 6.0, 7.0), 0.5 + 2 * np.pi)
    assert_allclose(closest_inside(40.0, -np.inf, np.inf), 40.0 - 12 * np.pi)
