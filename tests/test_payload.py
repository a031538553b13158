"""A payload at the tool, and robots whose masses are wrong: dynamics, bookkeeping, refusals."""

import json

import numpy as np
import pytest

from arm3dof.control.mpc import MpcController
from arm3dof.errors import InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.dynamics import ClosedForm
from arm3dof.model.library import load_robot
from arm3dof.model.payload import Payload
from arm3dof.model.robot import Description
from arm3dof.model.uncertainty import perturbed
from arm3dof.model.urdf import read_urdf
from arm3dof.model.validate import judge
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.recording import Recording
from arm3dof.sim.pinocchio_plant import PinocchioPlant

ROBOTS = ("arm3dof", "ur5", "panda", "z1", "so100", "xarm7")
LIMITS = ("q_min", "q_max", "v_max", "tau_max")


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request):
    return load_robot(request.param)


@pytest.fixture(scope="module")
def arm():
    return load_robot("arm3dof")


def states(robot, count, seed=5):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield robot.random_configuration(rng), *rng.normal(size=(2, robot.nv))


def assert_same_dynamics(a, b, *, exactly=True, count=20):
    """Compare M, C, g and both directions of the dynamics in random states."""
    same = (
        np.testing.assert_array_equal
        if exactly
        else lambda x, y: np.testing.assert_allclose(x, y, rtol=1e-10, atol=1e-12)
    )
    for q, v, third in states(a, count):
        same(a.mass_matrix(q), b.mass_matrix(q))
        same(a.coriolis(q, v), b.coriolis(q, v))
        same(a.gravity(q), b.gravity(q))
        same(a.inverse_dynamics(q, v, third), b.inverse_dynamics(q, v, third))
        if exactly:
            same(a.forward_dynamics(q, v, third), b.forward_dynamics(q, v, third))


# ---- dynamics ----------------------------------------------------------------------------------


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.03, -0.01, 0.02)])
@pytest.mark.parametrize("mass", [0.02, 0.1, 3.0])
def test_a_payload_moves_the_arm_as_a_link_of_the_urdf_would(arm, mass, com):
    places = {f"tool.com.{axis}": x for axis, x in zip("xyz", com, strict=True)}
    as_link = load_robot("arm3dof", overrides={"tool.mass": mass, **places})
    assert_same_dynamics(arm.with_payload(mass, com), as_link, exactly=False)


def test_a_payload_adds_the_energy_of_a_point_at_its_place(robot):
    rng = np.random.default_rng(3)
    for q, v, _ in states(robot, 10):
        mass, com = rng.uniform(0.01, 2.0), rng.uniform(-0.1, 0.1, 3)
        loaded = robot.with_payload(mass, com)
        jacobian = robot.jacobian(q)
        lever = robot.placement(q).rotation @ com
        point = jacobian[:3] + np.cross(jacobian[3:].T, lever).T  # its velocity a joint velocity
        extra = v @ (loaded.mass_matrix(q) - robot.mass_matrix(q)) @ v / 2
        assert extra == pytest.approx(mass / 2 * np.sum((point @ v) ** 2), rel=1e-8, abs=1e-10)
        held = loaded.gravity(q) - robot.gravity(q)
        weight = -mass * point.T @ robot.gravity_acceleration
        np.testing.assert_allclose(held, weight, atol=1e-9)


def test_the_closed_form_knows_the_payload(arm):
    loaded = arm.with_payload(0.1, (0.02, 0.01, -0.01))
    closed = ClosedForm.from_robot(loaded)
    for q, v, _ in states(arm, 20):
        np.testing.assert_allclose(closed.mass_matrix(q), loaded.mass_matrix(q), atol=1e-14)
        np.testing.assert_allclose(closed.gravity(q), loaded.gravity(q), atol=1e-13)
        np.testing.assert_allclose(closed.coriolis(q, v) @ v, loaded.coriolis(q, v) @ v, atol=1e-13)


# ---- taking up and putting down ----------------------------------------------------------------


def test_after_putting_it_down_the_dynamics_are_the_old_ones_to_the_last_bit(robot):
    loaded = robot.with_payload(0.137, (0.01, 0.02, 0.03))
    for bare in (
        loaded.without_payload(),
        loaded.clone().without_payload(),
        loaded.with_payload(2.0).with_payload(0.3).clone().without_payload(),
        robot.without_payload(),
        robot.with_payload(0.0, (0.1, 0.2, 0.3)),
        robot.with_payload(0.0).without_payload(),
    ):
        assert_same_dynamics(bare, robot)
    assert loaded.without_payload().payload is None


def test_a_robot_says_what_it_carries_and_stays_what_it_was(robot):
    before = [robot.mass_matrix(q) for q, _, _ in states(robot, 5)]
    loaded = robot.with_payload(0.1, np.array([0.0, 0.01, 0.0]))
    assert loaded.payload == Payload(0.1, (0.0, 0.01, 0.0))
    assert loaded.clone().payload == loaded.payload
    assert_same_dynamics(loaded.clone(), loaded)
    assert robot.payload is None
    for (q, _, _), mass in zip(states(robot, 5), before, strict=True):
        np.testing.assert_array_equal(robot.mass_matrix(q), mass)
    assert (loaded.name, loaded.joint_names) == (robot.name, robot.joint_names)
    assert (loaded.tool_frame, loaded.frame_names) == (robot.tool_frame, robot.frame_names)
    for name in LIMITS:
        np.testing.assert_array_equal(getattr(loaded.limits, name), getattr(robot.limits, name))
    np.testing.assert_array_equal(loaded.damping, robot.damping)
    np.testing.assert_array_equal(loaded.friction, robot.friction)


def test_a_second_payload_replaces_the_first(arm):
    assert_same_dynamics(arm.with_payload(5.0).with_payload(0.1), arm.with_payload(0.1))


@pytest.mark.parametrize("mass", [-1e-9, np.nan, np.inf, "1", None, True])
def test_an_impossible_mass_is_refused(arm, mass):
    with pytest.raises(InputError, match=r"payload's mass is .*; give 0 or more"):
        arm.with_payload(mass)


@pytest.mark.parametrize("com", [(0, 0), 0.1, (0, 0, np.nan), (np.inf, 0, 0), "here"])
def test_an_impossible_place_is_refused(arm, com):
    with pytest.raises(InputError, match="payload's com"):
        arm.with_payload(0.1, com)


# ---- descriptions and recordings ---------------------------------------------------------------


def test_a_description_brings_the_payload_along(robot):
    loaded = robot.with_payload(0.25, (0.0, 0.02, 0.0))
    kept = json.loads(json.dumps(loaded.description.to_dict()))
    again = robot_from_description(Description.from_dict(kept), robot.tool_frame)
    assert again.payload == loaded.payload
    assert_same_dynamics(again, loaded)
    assert_same_dynamics(again.without_payload(), robot)


def test_a_description_written_before_there_were_payloads_can_be_read(arm):
    kept = arm.description.to_dict()
    del kept["payload"]
    assert Description.from_dict(kept).payload is None


def test_a_recording_rebuilds_the_robot_with_its_payload(arm, tmp_path):
    loaded = arm.with_payload(0.05, (0.01, 0.0, 0.0))
    run = run_loop(PinocchioPlant(loaded), MpcController(loaded), np.zeros(3), 0.1)
    again = Recording.load(run.save(tmp_path / "run.npz")).load_robot()
    assert again.payload == loaded.payload
    assert_same_dynamics(again, loaded)


# ---- wrong masses ------------------------------------------------------------------------------


def test_no_error_is_no_change(robot):
    assert_same_dynamics(perturbed(robot, 0, sign=1), robot)
    assert_same_dynamics(perturbed(robot, 0, rng=np.random.default_rng(0)), robot)


def test_one_sign_scales_every_mass_alike(robot):
    for sign in (1, -1):
        wrong = perturbed(robot, 30, sign=sign, centroid_percent=0)
        factor = 1 + 0.3 * sign
        for q, _, _ in states(robot, 5):
            np.testing.assert_allclose(
                wrong.mass_matrix(q), factor * robot.mass_matrix(q), rtol=1e-9, atol=1e-12
            )
            np.testing.assert_allclose(
                wrong.gravity(q), factor * robot.gravity(q), rtol=1e-9, atol=1e-9
            )


def inertials(robot):
    """Return what the URDF says of each link that moves and has mass."""
    urdf, _ = read_urdf(robot.description.urdf)
    return [link.inertial for link in urdf.links[1:] if link.inertial is not None]


@pytest.mark.slow
def test_drawn_errors_stay_inside_their_bounds_and_differ(arm):
    rng = np.random.default_rng(8)
    ratios, shifts = [], []
    for _ in range(80):
        wrong = perturbed(arm, 30, rng=rng)
        for true, model in zip(inertials(wrong), inertials(arm), strict=True):
            ratios.append(true.mass / model.mass)
            placed = model.com != 0
            shifts += (true.com[placed] / model.com[placed]).tolist()
            np.testing.assert_allclose(true.inertia, ratios[-1] * model.inertia, rtol=1e-9)
    for drawn in (ratios, shifts):
        assert 0.7 <= min(drawn) < 0.72
        assert 1.28 < max(drawn) <= 1.3
        assert np.mean(drawn) == pytest.approx(1.0, abs=0.03)
    assert np.std(ratios) == pytest.approx(0.3 / np.sqrt(3), rel=0.1)


def test_every_wrong_robot_is_one_that_could_exist(robot):
    for seed in range(10):
        wrong = perturbed(robot, 95, rng=np.random.default_rng(seed))
        urdf, problems = read_urdf(wrong.description.urdf)
        assert not problems
        assert not judge(urdf, wrong.description.locked_joints)
        for q, _, _ in states(wrong, 3):
            assert np.linalg.eigvalsh(wrong.mass_matrix(q))[0] > 0


def test_a_seed_gives_the_same_robot_and_its_description_builds_it_again(robot):
    loaded = robot.with_payload(0.1)
    first, second = (perturbed(loaded, 20, rng=np.random.default_rng(4)) for _ in range(2))
    assert_same_dynamics(first, second)
    assert first.payload == loaded.payload
    again = robot_from_description(first.description, first.tool_frame)
    assert_same_dynamics(again, first)
    for name in LIMITS:
        np.testing.assert_array_equal(getattr(first.limits, name), getattr(robot.limits, name))
    other = perturbed(loaded, 20, rng=np.random.default_rng(5))
    assert np.abs(other.gravity(np.full(robot.nv, 0.1)) - again.gravity([0.1] * robot.nv)).max() > 0


@pytest.mark.parametrize(
    ("percent", "options", "reason"),
    [
        (100, {"sign": 1}, "percent is 100"),
        (-1, {"sign": 1}, "percent is -1"),
        (np.nan, {"sign": 1}, "percent is nan"),
        (10, {"sign": 1, "centroid_percent": 120}, "centroid_percent is 120"),
        (10, {"sign": 2}, "sign is 2"),
        (10, {}, "either rng"),
        (10, {"sign": 1, "rng": np.random.default_rng(0)}, "either rng"),
    ],
)
def test_errors_that_make_no_sense_are_refused(arm, percent, options, reason):
    with pytest.raises(InputError, match=reason):
        perturbed(arm, percent, **options)
