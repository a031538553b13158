"""The paper's experiment, for any robot."""

import numpy as np
import pytest

from arm3dof.control.settings import MpcSettings
from arm3dof.errors import InputError
from arm3dof.model.agreement import closed_form_agreement
from arm3dof.model.dh import DhMisfit
from arm3dof.model.library import load_robot
from arm3dof.runtime.experiment import (
    PAPER_TARGET_DEG,
    default_start,
    default_target,
    simulate,
)
from arm3dof.runtime.metrics import summarise

ROBOTS = ("arm3dof", "ur5", "panda", "z1", "so100", "so101", "xarm7")


@pytest.mark.parametrize("name", ROBOTS)
def test_defaults_are_inside_the_limits(name):
    robot = load_robot(name)
    start = default_start(robot)
    target = default_target(robot, start)
    for q in (start, target):
        assert np.all(robot.limits.q_min <= q)
        assert np.all(q <= robot.limits.q_max)
    assert np.all(np.abs(target - start) > np.deg2rad(5))
    # 0 wherever a joint may be there
    zero = (robot.limits.q_min <= 0) & (robot.limits.q_max >= 0)
    assert np.all(start[zero] == 0)


def test_the_reference_arm_does_the_papers_experiment():
    robot = load_robot()
    np.testing.assert_array_equal(default_start(robot), 0)
    np.testing.assert_allclose(
        default_target(robot, default_start(robot)), np.deg2rad(PAPER_TARGET_DEG)
    )


def test_a_paper_target_outside_the_limits_is_not_the_default():
    robot = load_robot("arm3dof", overrides={"joint2.upper": 1.0})
    target = default_target(robot, np.zeros(3))
    np.testing.assert_allclose(np.abs(target[[0, 2]]), np.deg2rad(30))
    assert target[1] == pytest.approx(np.deg2rad(30))


@pytest.mark.parametrize("dt", [0.05, 0.02, 0.033, 0.0007])
def test_the_plants_step_divides_the_controllers(dt):
    robot = load_robot()
    settings = MpcSettings(dt=dt, horizon=5)
    run = simulate(robot, np.zeros(3), [0.1, 0.1, 0.1], settings=settings, duration=10 * dt)
    step = np.diff(run.t)
    assert step.max() <= 0.001 + 1e-9
    assert run.control_rows.sum() == 10


def test_the_run_starts_at_rest_and_arrives():
    robot = load_robot()
    start, target = np.array([0.2, 0.1, -0.3]), np.array([-0.2, 0.6, 0.4])
    run = simulate(robot, start, target, duration=3.0, notes={"who": "me"})
    np.testing.assert_array_equal(run.q[0], start)
    np.testing.assert_array_equal(run.v[0], 0)
    assert summarise(run).settled
    assert run.notes["who"] == "me"


def test_simulate_refuses_another_robots_start():
    with pytest.raises(InputError):
        simulate(load_robot(), np.zeros(2), np.zeros(3))


def test_closed_form_and_pinocchio_agree():
    agreement = closed_form_agreement(load_robot(), np.random.default_rng(1), samples=200)
    assert max(agreement) < 1e-13
    with pytest.raises(DhMisfit):
        closed_form_agreement(load_robot("ur5"), np.random.default_rng(1))
