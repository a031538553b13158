"""The servo model: its limits, its play, its delay and what its encoder says."""

import numpy as np
import pytest

from arm3dof.control.mpc import MpcController
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.model.servos import SERVOS
from arm3dof.runtime.loop import run_loop
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.servo import Servo, holding_torque
from arm3dof.state import JointState

ROBOT = load_robot("arm3dof")
DT = 0.001
REST = JointState(0.0, np.array([0.2, 0.5, -0.7]), np.zeros(3))
DEGREE = np.deg2rad(1.0)


def driven(servo, rng=None, **at):
    drive = servo.drive(ROBOT, DT, rng)
    drive.reset(at.get("state", REST), at.get("holding", np.zeros(3)))
    return drive


def test_the_torque_speed_line_bounds_every_command():
    rng = np.random.default_rng(0)
    for _ in range(300):
        stall, free, supply = rng.uniform(0.2, 3), rng.uniform(2, 10), rng.uniform(0.3, 1.2)
        v = rng.uniform(-1.5, 1.5, 3) * free
        drive = driven(Servo(stall, free, supply=supply), state=JointState(0.0, REST.q, v))
        command = rng.normal(0, 3, 3)
        tau = drive.torque(command, v)
        low, high = drive.limits(v)
        assert (low <= tau).all()
        assert (tau <= high).all()
        assert (np.abs(tau) <= supply * stall + 1e-12).all()
        inside = (command > low) & (command < high)
        np.testing.assert_array_equal(tau[inside], command[inside])
        # at the no-load speed nothing is left to go faster
        assert driven(Servo(stall, free)).limits(np.full(3, free))[1] == pytest.approx(0)


@pytest.mark.parametrize("folded", [0.0, 1.5])
def test_a_joint_goes_no_faster_than_the_motor_lets_it(folded):
    """Also where the arm points up and its first joint feels hardly any inertia."""
    servo = Servo(1.96, 3.0, supply=0.8)
    plant = PinocchioPlant(ROBOT, servo=servo)
    plant.reset(JointState(0.0, np.array([-2.0, folded, 0.0]), np.zeros(3)))
    speeds = []
    for _ in range(700):
        hold = 30 * (folded - plant.state.q[1]), -3 * plant.state.q[2]
        pull = ROBOT.gravity(plant.state.q)[1:] + hold - 0.1 * plant.state.v[1:]
        speeds.append(plant.step([1.9, *pull]).v[0])
    assert max(speeds[50:]) < 1.02 * 0.8 * 3.0
    assert np.mean(speeds[-100:]) == pytest.approx(0.8 * 3.0, rel=0.03)


def test_an_ideal_servo_changes_nothing():
    plain, driven_plant = PinocchioPlant(ROBOT), PinocchioPlant(ROBOT, servo=Servo(1e3, 1e6))
    rng = np.random.default_rng(1)
    plain.reset(REST)
    driven_plant.reset(REST)
    for _ in range(200):
        tau = rng.normal(0, 0.5, 3)
        np.testing.assert_allclose(plain.step(tau).q, driven_plant.step(tau).q, atol=1e-12)
    np.testing.assert_array_equal(driven_plant.measure().v, driven_plant.state.v)


def test_commands_come_late_and_the_arm_is_held_until_then():
    holding = np.array([0.0, 0.3, 0.1])
    drive = driven(Servo(2.0, 7.0, delay=0.02), holding=holding)
    given = [np.full(3, 0.01 * k) for k in range(60)]
    acted = [drive.torque(tau, REST.v) for k, tau in enumerate(given)]
    np.testing.assert_allclose(acted[:20], np.tile(holding, (20, 1)))
    np.testing.assert_allclose(acted[20:], given[:40])


def test_friction_of_the_servo_is_the_plants():
    dry = PinocchioPlant(ROBOT, servo=Servo(1.96, 7.5, friction=0.1))
    dry.reset(REST)
    for _ in range(400):
        state = dry.step(ROBOT.gravity(REST.q) + 0.09)
    np.testing.assert_allclose(state.q, REST.q, atol=1e-9)
    viscous = PinocchioPlant(ROBOT, servo=Servo(1.96, 7.5, damping=0.05))
    damped = PinocchioPlant(
        load_robot("arm3dof", overrides={f"joint{i}.damping": 0.06 for i in (1, 2, 3)})
    )
    for plant in (viscous, damped):
        plant.reset(REST)
        for _ in range(300):
            plant.step([0.1, 0.2, 0.1])
    np.testing.assert_allclose(viscous.state.q, damped.state.q, atol=1e-9)


# ---- backlash ----------------------------------------------------------------------------------


def test_the_play_stays_inside_the_gap_and_no_torque_exceeds_the_motors():
    rng = np.random.default_rng(2)
    for gap in (0.2 * DEGREE, DEGREE, 3 * DEGREE):
        drive = driven(Servo(1.96, 7.5, backlash=gap))
        v = np.zeros(3)
        for _ in range(3000):
            v = np.clip(v + rng.normal(0, 0.05, 3), -3, 3)
            tau = drive.torque(rng.normal(0, 1, 3), v)
            assert (np.abs(drive.play) <= gap / 2 + 1e-12).all()
            assert (np.abs(tau) <= 1.96 + 1e-9).all()


def test_a_reversal_crosses_the_play_in_the_time_that_the_motor_takes():
    gap, inertia, tau = DEGREE, 1e-3, 0.3
    drive = driven(Servo(1.96, 1e3, backlash=gap, rotor_inertia=inertia), holding=np.full(3, tau))
    np.testing.assert_allclose(drive.play, gap / 2)
    assert drive.torque(np.full(3, tau), REST.v) == pytest.approx(tau)
    through = [float(drive.torque(np.full(3, -tau), REST.v)[0]) for _ in range(100)]
    crossing = next(k for k, torque in enumerate(through) if torque)
    assert crossing * DT == pytest.approx(np.sqrt(2 * gap * inertia / tau), abs=2 * DT)
    # what the motor took up on its way arrives, without a torque above the motor's
    assert sum(through) * DT == pytest.approx(-tau * len(through) * DT, rel=1e-9)
    assert min(through) >= -1.96
    np.testing.assert_allclose(drive.play, -gap / 2)
    assert through[-1] == pytest.approx(-tau)


def test_backlash_under_a_load_is_not_felt():
    """A torque that never changes its sign keeps to one flank."""
    with_play = PinocchioPlant(ROBOT, servo=Servo(1.96, 7.5, backlash=DEGREE))
    without = PinocchioPlant(ROBOT, servo=Servo(1.96, 7.5))
    q = np.array([0.0, 0.3, 0.2])
    for plant in (with_play, without):
        plant.reset(JointState(0.0, q, np.zeros(3)))
        for k in range(500):
            plant.step(np.array([0.0, 1.0, 1.0]) * (ROBOT.gravity(q) + 0.02 * np.sin(0.02 * k)))
    np.testing.assert_allclose(with_play.state.q[1:], without.state.q[1:], atol=1e-9)


@pytest.mark.parametrize("encoder", ["joint", "motor"])
def test_the_controller_lives_with_a_degree_of_backlash(encoder):
    servo = Servo.named(
        "DS3218", ROBOT, friction=0.02, backlash=DEGREE, encoder=encoder, resolution=0.0
    )
    plant = PinocchioPlant(ROBOT, servo=servo)
    plant.reset(JointState(0.0, np.zeros(3), np.zeros(3)))
    target = np.array([0.5, 0.9, -0.8])
    recording = run_loop(plant, MpcController(ROBOT), target, 3.0)
    assert np.isfinite(recording.q).all()
    assert np.abs(recording.e[-300:]).max() < 2 * DEGREE


# ---- encoders ----------------------------------------------------------------------------------


def test_positions_come_in_whole_steps_and_are_the_same_when_asked_twice():
    step = SERVOS["STS3215-12V"].resolution
    rng = np.random.default_rng(3)
    drive = driven(Servo(2.0, 7.0, resolution=step, noise=0.3 * step), rng)
    for k in range(200):
        state = JointState(DT * k, rng.uniform(-2, 2, 3), np.zeros(3))
        read = drive.measure(state)
        np.testing.assert_allclose(read.q / step, np.round(read.q / step), atol=1e-6)
        assert (np.abs(read.q - state.q) < 2.5 * step).all()
        again = drive.measure(state)
        np.testing.assert_array_equal(again.q, read.q)
        np.testing.assert_array_equal(again.v, read.v)


def test_the_velocity_errs_by_the_slope_of_the_positions_error():
    """Summed up, the error of the velocity is the smoothed error of the position."""
    step = 0.01
    drive = driven(
        Servo(2.0, 7.0, resolution=step), state=JointState(0.0, np.zeros(3), np.zeros(3))
    )
    v, total = np.array([0.3, -0.2, 0.05]), np.zeros(3)
    for k in range(1, 3000):
        read = drive.measure(JointState(DT * k, v * DT * k, v))
        total += DT * (read.v - v)
        assert (np.abs(total) <= step).all()
    assert (np.abs(total) < step).all()


def test_an_encoder_on_the_motor_sees_the_play():
    servo = Servo(2.0, 7.0, backlash=DEGREE, encoder="motor")
    drive = driven(servo, holding=np.array([0.0, 0.2, -0.2]))
    told = drive.measure(REST).q - REST.q
    np.testing.assert_allclose(told, [0.0, DEGREE / 2, -DEGREE / 2], atol=1e-12)


# ---- construction ------------------------------------------------------------------------------


def test_named_servos_bring_their_data_sheet():
    data = SERVOS["XL430"]
    servo = Servo.named("XL430", ROBOT, voltage=6.0, backlash=DEGREE)
    np.testing.assert_allclose(servo.each("stall_torque", 3), data.stall_torque / 2)
    np.testing.assert_allclose(servo.each("no_load_speed", 3), data.no_load_speed / 2)
    np.testing.assert_allclose(servo.each("resolution", 3), data.resolution)
    mixed = Servo.named({"joint2": "XL430"}, ROBOT)
    np.testing.assert_allclose(mixed.each("stall_torque", 3), [1.96, 1.5, 1.96])
    np.testing.assert_allclose(mixed.each("resolution", 3), [0, data.resolution, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stall_torque": 0}, "stall_torque is 0.0; give finite numbers above 0"),
        ({"backlash": -1e-3}, "backlash is -0.001; give finite numbers of 0 or more"),
        ({"friction": np.nan}, "friction is nan"),
        ({"rotor_inertia": 0}, "rotor_inertia"),
        ({"encoder": "shaft"}, "give 'joint' or 'motor'"),
    ],
)
def test_impossible_servos_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        Servo(**{"stall_torque": 2.0, "no_load_speed": 7.0, **change})


def test_noise_needs_a_source_and_shapes_must_fit():
    with pytest.raises(InputError, match="noise needs a source"):
        PinocchioPlant(ROBOT, servo=Servo(2.0, 7.0, noise=0.01))
    with pytest.raises(InputError, match="backlash has shape"):
        PinocchioPlant(ROBOT, servo=Servo(2.0, 7.0, backlash=[0.01, 0.01]))


def test_holding_is_gravity_inside_the_limits():
    np.testing.assert_array_equal(holding_torque(ROBOT, REST.q), ROBOT.gravity(REST.q))
    heavy = ROBOT.with_payload(5.0)
    assert np.abs(holding_torque(heavy, np.zeros(3))).max() == pytest.approx(1.96)
