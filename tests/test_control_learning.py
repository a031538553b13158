"""What the controller learns about the arm, looks ahead to, and follows: in closed loop."""

import numpy as np
import pytest

from arm3dof.control.mpc import MpcController
from arm3dof.control.observer import Observer
from arm3dof.control.reference import JointTrajectory, cartesian_path, sample_target
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import ControlStatus
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.loop import run_loop
from arm3dof.runtime.metrics import summarise
from arm3dof.sim.disturbance import (
    DisturbedPlant,
    JointTorque,
    PayloadChange,
    Push,
)
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.state import JointState

TARGET = np.deg2rad([28.1, 67.8, 53.8])
DT = 0.0025  # of the plants [s]; in motions like these RK4 errs by some 1e-6 rad


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


def run(robot, plant, target=TARGET, duration=3.0, **settings):
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
    controller = MpcController(robot, MpcSettings(**settings))
    return run_loop(plant, controller, target, duration), controller


def back_inside(recording, since):
    """Seconds after ``since`` until every error stays inside half a degree."""
    outside = (np.abs(recording.e) > np.deg2rad(0.5)).any(axis=1) & (recording.t >= since)
    return float(recording.t[outside][-1] - since) if outside.any() else 0.0


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("formulation", ["tracking", "torque"])
def test_an_unknown_load_and_wrong_masses_leave_no_steady_error(robot, sign, formulation):
    truth = perturbed(robot, 30, sign=sign, centroid_percent=0).with_payload(0.1)
    recording, controller = run(robot, PinocchioPlant(truth, DT), formulation=formulation)
    assert np.rad2deg(summarise(recording).final_error) <= 0.05
    assert controller.observer.estimator.load == pytest.approx(0.1, abs=0.02)
    without, _ = run(robot, PinocchioPlant(truth, DT), formulation=formulation, observer_gain=0.0)
    assert np.rad2deg(summarise(without).final_error) > 1.0


def test_a_load_is_weighed_and_forgotten_when_it_is_put_down(robot):
    plant = DisturbedPlant(
        PinocchioPlant(robot, DT), payloads=[PayloadChange(1.0, 0.06), PayloadChange(2.5, None)]
    )
    weighed = []
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
    controller = MpcController(robot)

    def watch(state, step):
        weighed.append((state.t, controller.observer.estimator.load))

    recording = run_loop(plant, controller, TARGET, 5.0, [watch])
    t, load = np.array(weighed).T
    assert load[(t > 0.5) & (t < 1.0)] == pytest.approx(0.0, abs=1e-3)
    assert load[(t > 2.0) & (t < 2.5)] == pytest.approx(0.06, abs=0.01)
    assert load[-1] == pytest.approx(0.0, abs=2e-3)
    assert np.rad2deg(summarise(recording).final_error) < 0.05


@pytest.mark.parametrize("settings", [{}, {"input_weight": 3e-5}])
def test_pushes_and_moments_are_overcome_within_a_second(robot, settings):
    for joint in range(3):
        push = DisturbedPlant(PinocchioPlant(robot, DT), pushes=[Push(1.5, joint, np.deg2rad(10))])
        assert back_inside(run(robot, push, **settings)[0], 1.5) < 1.0
        moment = DisturbedPlant(
            PinocchioPlant(robot, DT), wrenches=[JointTorque(1.5, joint, 0.5, 0.2)]
        )
        assert back_inside(run(robot, moment, **settings)[0], 1.5) < 1.0


@pytest.mark.parametrize("delay", [0.02, 0.05, 0.08])
def test_a_declared_delay_costs_little_and_an_undeclared_one_shows(robot, delay):
    prompt, _ = run(robot, PinocchioPlant(robot, DT), input_weight=1e-3)
    plant = DisturbedPlant(PinocchioPlant(robot, DT), delay=delay)
    declared, _ = run(robot, plant, input_weight=1e-3, delay=delay)
    undeclared, _ = run(robot, plant, input_weight=1e-3)
    best, known, unknown = map(summarise, (prompt, declared, undeclared))
    assert known.settling_time <= 1.2 * best.settling_time + delay
    if delay > 0.02:  # the filter takes less than half a sample of lateness as it comes
        assert (unknown.settling_time or np.inf) > 1.2 * known.settling_time


def test_prediction_over_a_delay_is_exact_for_commands_that_are_obeyed(robot):
    rng = np.random.default_rng(0)
    dt, delay = 0.05, 0.13
    observer = Observer(robot.clone(), dt, gain=0.0, delay=delay)
    accelerations = rng.normal(size=(10, 3))
    for u in accelerations:
        observer.command(u, np.zeros(3))
    q, v = rng.normal(size=3), rng.normal(size=3)
    observer.measure(JointState(1.0, q, v))
    predicted = observer.predict(1.0)
    assert predicted.t == pytest.approx(1.0 + delay)
    # what acts now was commanded three steps ago, and acts for 0.03 s more
    for u, span in zip(accelerations[-3:], (0.03, 0.05, 0.05), strict=True):
        q, v = q + span * v + span**2 / 2 * u, v + span * u
    np.testing.assert_allclose(predicted.q, q)
    np.testing.assert_allclose(predicted.v, v)


def test_a_trajectory_is_followed_better_than_its_end_point(robot):
    times = np.linspace(0.0, 2.0, 9)
    knots = TARGET * np.sin(np.linspace(0, np.pi / 2, 9))[:, np.newaxis]
    trajectory = JointTrajectory(times, knots)
    followed, _ = run(robot, PinocchioPlant(robot, DT), trajectory)
    assert np.rad2deg(np.abs(followed.e).max()) < 3.0
    assert summarise(followed).settled
    # a step along the path, sampled anew each time, asks for less torque than a jump to the end
    jumped, _ = run(robot, PinocchioPlant(robot, DT))
    assert summarise(followed).peak_torque < summarise(jumped).peak_torque


def test_trajectories_pass_through_their_knots_at_their_slopes():
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.1, 0.5, 8))
    trajectory = JointTrajectory(times, rng.normal(size=(8, 4)))
    at_knots = trajectory.sample(times)
    np.testing.assert_allclose(at_knots.q, trajectory.q, atol=1e-12)
    np.testing.assert_allclose(at_knots.v, trajectory.v, atol=1e-12)
    fine = np.linspace(times[0], times[-1], 20_001)
    path = trajectory.sample(fine)
    slopes = np.gradient(path.q, fine, axis=0)[1:-1]
    np.testing.assert_allclose(slopes, path.v[1:-1], atol=5e-3)
    outside = trajectory.sample([times[0] - 1, times[-1] + 1])
    np.testing.assert_array_equal(outside.q, trajectory.q[[0, -1]])
    np.testing.assert_array_equal(outside.v, 0.0)


def test_a_cartesian_path_keeps_to_one_branch(robot):
    angle = np.linspace(0, 2 * np.pi, 41)
    points = np.stack([0.17 + 0 * angle, 0.05 * np.cos(angle), 0.05 + 0.05 * np.sin(angle)], axis=1)
    path = cartesian_path(robot, points, 0.1 * np.arange(41))
    for point, q in zip(points, path.q, strict=True):
        np.testing.assert_allclose(robot.placement(q).translation, point, atol=1e-9)
    assert np.abs(np.diff(path.q, axis=0)).max() < 0.4
    with pytest.raises(InputError, match="point 1 of the path"):
        cartesian_path(robot, [[0.2, 0, 0], [0.9, 0, 0]], [0, 1])


def test_targets_of_another_robot_and_broken_trajectories_are_refused(robot):
    with pytest.raises(InputError, match="2 joints; the robot has 3"):
        sample_target(JointTrajectory([0, 1], np.zeros((2, 2))), 3, 0.0, 0.05, 20)
    with pytest.raises(InputError, match="increasing"):
        JointTrajectory([0, 0], np.zeros((2, 3)))
    with pytest.raises(InputError, match="finite"):
        JointTrajectory([0, 1], np.full((2, 3), np.nan))


def test_torque_changes_no_faster_than_allowed(robot):
    recording, _ = run(robot, PinocchioPlant(robot, DT), torque_rate=4.0)
    tau = np.vstack([robot.gravity(np.zeros(3)), recording.tau[recording.control_rows]])
    assert np.abs(np.diff(tau, axis=0)).max() <= 4.0 * 0.05 + 1e-9
    assert summarise(recording).settled
    free, _ = run(robot, PinocchioPlant(robot, DT))
    assert np.abs(np.diff(free.tau[free.control_rows], axis=0)).max() > 0.4


def test_blocks_share_their_decisions_and_cost_little(robot):
    blocks = (1, 1, 1, 2, 3, 4, 8)
    controller = MpcController(robot, MpcSettings(blocks=blocks))
    optimum = controller.optimise(JointState(0.0, np.zeros(3), np.zeros(3)), TARGET)
    assert optimum.w.size == 3 * len(blocks)
    recording, _ = run(robot, PinocchioPlant(robot, DT), blocks=blocks)
    full, _ = run(robot, PinocchioPlant(robot, DT))
    assert summarise(recording).settled
    assert summarise(recording).rms_error < 1.05 * summarise(full).rms_error


@pytest.mark.parametrize("settling_time", [0.4, 0.8, 1.6])
@pytest.mark.parametrize("name", ["arm3dof", "ur5"])
def test_tuned_settings_settle_in_the_time_that_was_asked_for(name, settling_time):
    arm = load_robot(name)
    plant = PinocchioPlant(arm, DT)
    start = np.zeros(arm.nv)
    plant.reset(JointState(0.0, start, start))
    controller = MpcController(arm, MpcSettings.tuned(settling_time))
    recording = run_loop(plant, controller, start + 0.3, 3 * settling_time)
    moved = np.abs(recording.e).max(axis=1) > 0.01 * 0.3
    assert recording.t[moved][-1] == pytest.approx(settling_time, rel=0.25)


def test_a_jump_of_the_arm_teaches_nothing_about_its_load(robot):
    controller = MpcController(robot)
    rng = np.random.default_rng(2)
    for _ in range(30):
        state = JointState(0.0, robot.random_configuration(rng), rng.normal(size=3))
        controller.step(state, TARGET)
    assert controller.observer.estimator.load == 0.0
    np.testing.assert_array_equal(controller.observer.disturbance, 0.0)


@pytest.mark.parametrize(
    ("speed", "far", "lost"), [(0.0, 0.15, True), (5.0, 0.2, False), (5.0, 1.0, True)]
)
def test_a_plan_outlives_a_jump_that_is_shorter_than_the_way(robot, speed, far, lost):
    rng = np.random.default_rng(4)
    for _ in range(10):
        controller = MpcController(robot, MpcSettings(observer_gain=0.0))
        q, target, v = 0.3 * rng.normal(size=3), 0.3 * rng.normal(size=3), np.zeros(3)
        joint = rng.integers(3)
        v[joint] = speed
        for k in range(3):
            controller.step(JointState(0.0, q + controller.dt * k * v, v), target)
        away = controller.dt * 3 * v
        away[joint] += far
        pushed = JointState(0.0, q + away, v)
        step = controller.step(pushed, target)
        assert controller.observer.jumped
        assert controller.observer.lost is lost
        optimum = controller.optimise(pushed, target).tau[0]
        np.testing.assert_allclose(step.tau, optimum, atol=0.02 * robot.limits.tau_max.min())


def test_one_bad_step_leaves_no_trace(robot):
    rng = np.random.default_rng(3)
    state, target = JointState(0.0, np.zeros(3), np.zeros(3)), 0.3 * TARGET
    fresh = MpcController(robot).step(state, target)
    controller = MpcController(robot)
    for broken in (np.nan, np.inf, 1e300):
        bad = JointState(0.0, np.full(3, broken), rng.normal(size=3))
        assert controller.step(bad, target).status is ControlStatus.BAD_MEASUREMENT
        after = controller.step(state, target)
        assert after.status is ControlStatus.SOLVED
        np.testing.assert_allclose(after.tau, fresh.tau, atol=1e-6)


def test_settings_of_the_new_kind_are_checked():
    bad = {
        "blocks": (5, 5),
        "observer_gain": 1.5,
        "delay": -0.1,
        "measurement_noise": -1.0,
    }
    for name, value in bad.items():
        with pytest.raises(InputError, match=name):
            MpcSettings(**{name: value})
    with pytest.raises(InputError, match="torque_rate"):
        MpcController(load_robot("arm3dof"), MpcSettings(torque_rate=-1.0))
    with pytest.raises(InputError, match="settling_time"):
        MpcSettings.tuned(0.0)


@pytest.mark.parametrize("noise_deg", [0.0, 0.1])
def test_an_end_stop_that_was_run_into_is_left_again(robot, noise_deg):
    target = np.array([robot.limits.q_max[0] - 0.01, 2.4, -0.2])
    for seed in range(3):
        truth = perturbed(robot, 30, rng=np.random.default_rng(seed))
        inner = PinocchioPlant(truth, DT, end_stops=True)
        plant = DisturbedPlant(
            inner,
            # leans on the stop for a while, as hard as its motor can
            wrenches=[JointTorque(0.8, "joint1", 1.5, 0.3)],
            noise=np.deg2rad(noise_deg),
            rng=np.random.default_rng(seed),
        )
        plant.reset(JointState(0.0, np.array([0.5, 2.0, 0.5]), np.zeros(3)))
        recording = run_loop(plant, MpcController(robot), target, 3.0)
        assert (recording.q[:, 0] == robot.limits.q_max[0]).any()
        metrics = summarise(recording)
        assert metrics.settled
        assert metrics.settling_time < 1.1 + 1.2
