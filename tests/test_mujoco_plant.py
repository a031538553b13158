"""The plant with contact: the protocol, the gripper, and what it holds, drops and knocks over."""

import numpy as np
import pytest

from arm3dof.control.mpc import MpcController
from arm3dof.errors import ArmError, InputError
from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.library import load_robot
from arm3dof.runtime.loop import run_loop
from arm3dof.sim.disturbance import DisturbedPlant, PayloadChange, Push, Wrench
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.scatter import scatter
from arm3dof.sim.servo import Servo
from arm3dof.sim.world import COLOURS, SHAPES, Bin, Body, World
from arm3dof.state import JointState

AHEAD = np.array([0.19, 0.05])
CAN = Body("can", "cylinder", 0.03, 0.06, 0.04, COLOURS["red"], *AHEAD)


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


def at(q):
    return JointState(0.0, np.asarray(q, float), np.zeros(np.size(q)))


def above(robot, height, xy=AHEAD, near=None):
    """Return joint positions that bring the tool so far above the table [m]."""
    return inverse_kinematics(robot, [*xy, -0.11 + height], near=near).best


def drive(plant, controller, target, duration):
    """Let a controller drive the plant, and return the state after it."""
    hold = round(controller.dt / plant.dt)
    for step in range(round(duration / plant.dt)):
        if step % hold == 0:
            answer = controller.step(plant.measure(), target)
        plant.step(answer.tau)
    return plant.state


def hold_still(plant, duration):
    for _ in range(round(duration / plant.dt)):
        plant.step(plant.robot.gravity(plant.state.q))


# ---- the protocol ------------------------------------------------------------------------------


def test_it_moves_as_pinocchios_plant_does(robot):
    ours, theirs = MujocoPlant(robot), PinocchioPlant(robot)
    q = np.array([0.3, 0.8, -0.5])
    for plant in (ours, theirs):
        plant.reset(at(q))
        for step in range(300):
            plant.step(robot.gravity(q) + 0.05 * np.sin(0.02 * step))
    assert ours.state.t == pytest.approx(theirs.state.t) == pytest.approx(0.3)
    np.testing.assert_allclose(ours.state.q, theirs.state.q, atol=2e-3)
    assert np.abs(theirs.state.q - q).max() > 0.1


def test_a_controller_settles_it_as_it_settles_pinocchios_plant(robot):
    target = np.deg2rad([28.1, 67.8, 53.8])
    finals = []
    for plant in (MujocoPlant(robot), PinocchioPlant(robot)):
        plant.reset(at(np.zeros(3)))
        recording = run_loop(plant, MpcController(robot), target, 1.5)
        finals.append(recording.q[-1])
        assert np.abs(recording.tau).max() <= 1.96
    np.testing.assert_allclose(finals[0], target, atol=1e-4)
    np.testing.assert_allclose(finals[0], finals[1], atol=1e-4)


def test_a_load_that_is_unknown_is_held_like_one_that_is_known(robot):
    target = np.array([0.4, 0.9, -0.7])
    for known in (True, False):
        finals = []
        for make in (MujocoPlant, PinocchioPlant):
            plant = make(robot.with_payload(0.1))
            plant.reset(at([0.0, 1.2, -1.0]))
            controller = MpcController(robot.with_payload(0.1) if known else robot)
            finals.append(run_loop(plant, controller, target, 2.5).q[-1])
        np.testing.assert_allclose(finals[0], target, atol=2e-3)
        np.testing.assert_allclose(finals[0], finals[1], atol=2e-3)


def test_torques_are_held_to_their_limits(robot):
    plant = MujocoPlant(robot)
    np.testing.assert_array_equal(plant.applied_torque, 0.0)
    plant.step([9.0, -9.0, 0.5])
    np.testing.assert_array_equal(plant.applied_torque, [1.96, -1.96, 0.5])


def test_joints_stop_at_their_ends(robot):
    plant = MujocoPlant(robot)
    for _ in range(2000):
        plant.step([1.96, 1.96, 1.96])
    # the upper arm lies on the joint's end, or the forearm is pressed on something before it
    assert (plant.state.q <= robot.limits.q_max + 0.01).all()
    assert plant.state.q[0] == pytest.approx(robot.limits.q_max[0], abs=0.02)
    np.testing.assert_allclose(plant.state.v, 0.0, atol=1e-2)


def test_it_stops_on_the_table(robot):
    plant = MujocoPlant(robot)
    plant.reset(at([0.0, 0.2, -0.4]))
    for _ in range(3000):
        plant.step(np.zeros(3))
    corners = robot.placement(plant.state.q).act(np.array([0.016, -0.0085, 0.0]))
    assert corners[2] > -0.113
    np.testing.assert_allclose(plant.state.v, 0.0, atol=1e-3)


def test_steps_longer_than_the_integrators_are_divided(robot):
    ends = []
    for dt in (0.001, 0.010):
        plant = MujocoPlant(robot, dt=dt)
        plant.reset(at([0.1, 0.9, -0.6]))
        for _ in range(round(0.2 / dt)):
            plant.step([0.02, 0.25, 0.1])
        assert plant.state.t == pytest.approx(0.2)
        ends.append(plant.state.q)
    np.testing.assert_allclose(ends[0], ends[1], atol=5e-3)


def test_reset_brings_everything_back(robot):
    plant = MujocoPlant(robot, World(bodies=(CAN,)))
    plant.reset(at(above(robot, 0.06)))
    plant.command_gripper(0.0)
    for _ in range(300):
        plant.step([0.5, 0.0, 0.0])
    first = plant.reset(at(above(robot, 0.1)))
    np.testing.assert_array_equal(first.q, above(robot, 0.1))
    np.testing.assert_allclose(plant.body_pose("can")[:3, 3], [*AHEAD, -0.08], atol=1e-12)
    assert plant.gripper.opening == pytest.approx(0.066)
    assert plant.gripper.command == pytest.approx(0.066)


def test_bad_inputs_are_refused(robot):
    for dt in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="dt is"):
            MujocoPlant(robot, dt=dt)
    plant = MujocoPlant(robot)
    with pytest.raises(InputError, match="needs 3 finite"):
        plant.reset(at([np.nan, 0.0, 0.0]))
    with pytest.raises(InputError, match="tau is"):
        plant.step([np.nan, 0.0, 0.0])
    with pytest.raises(InputError, match="opening is nan"):
        plant.command_gripper(np.nan)
    with pytest.raises(InputError, match="no body 'can'"):
        plant.body_pose("can")
    with pytest.raises(InputError, match="this plant goes on with joint1, joint2, joint3"):
        plant.change_robot(load_robot("ur5"))


def test_a_breakdown_is_told(robot):
    plant = MujocoPlant(robot)
    plant.data.qvel[:] = np.nan
    with pytest.raises(ArmError, match=r"the physics world broke down at 0\.001 s"):
        plant.step(np.zeros(3))


def test_a_robot_without_fingers_has_no_gripper():
    plant = MujocoPlant(load_robot("ur5"))
    assert not plant.has_gripper
    with pytest.raises(InputError, match="no gripper"):
        plant.command_gripper(0.0)
    hold_still(plant, 0.1)
    np.testing.assert_allclose(plant.state.v, 0.0, atol=1e-3)


SERVOS = {
    "ideal": Servo(1.96, 7.5),
    "sticky": Servo(1.96, 7.5, friction=0.05, damping=0.02),
    "coarse": Servo(1.96, 7.5, resolution=0.01, delay=0.01),
    "worn": Servo(1.96, 7.5, backlash=np.deg2rad(1.0), encoder="motor"),
}


@pytest.mark.parametrize("name", SERVOS)
def test_servos_do_here_what_they_do_in_pinocchios_plant(robot, name):
    servo, q = SERVOS[name], np.array([0.3, 0.9, -0.6])
    moved, measured = [], []
    for plant in (MujocoPlant(robot, servo=servo), PinocchioPlant(robot, servo=servo)):
        plant.reset(at(q))
        for step in range(150):
            plant.step(robot.gravity(q) + np.array([0.15, 0.10, -0.08]) * (step < 100))
        moved.append(plant.state.q)
        measured.append(plant.measure().q)
    assert np.abs(moved[1] - q).max() > 0.05
    np.testing.assert_allclose(moved[0], moved[1], atol=0.01)
    np.testing.assert_allclose(measured[0], measured[1], atol=0.02)


def test_a_sticky_servo_holds_what_friction_can_hold(robot):
    plant = MujocoPlant(robot, servo=Servo(1.96, 7.5, friction=0.1))
    q = np.array([0.3, 0.9, -0.6])
    plant.reset(at(q))
    for _ in range(1000):
        plant.step(robot.gravity(q) + 0.08)
    np.testing.assert_allclose(plant.state.q, q, atol=2e-4)


# ---- disturbances ------------------------------------------------------------------------------


def test_what_befalls_pinocchios_plant_can_befall_it(robot):
    q = np.array([0.2, 1.0, -0.8])
    ends = []
    for bare in (MujocoPlant(robot), PinocchioPlant(robot)):
        plant = DisturbedPlant(
            bare,
            payloads=[PayloadChange(0.0, 0.1)],
            pushes=[Push(0.05, "joint1", 0.2)],
            wrenches=[Wrench(0.02, np.array([0.0, 0.5, 1.0]), duration=0.1)],
        )
        plant.reset(at(q))
        for _ in range(200):
            plant.step(robot.with_payload(0.1).gravity(q))
        ends.append(plant.state.q)
    np.testing.assert_allclose(ends[0], ends[1], atol=2e-3)
    assert ends[0][0] > 0.35


# ---- gripping ----------------------------------------------------------------------------------


def test_the_gripper_closes_at_the_servos_speed_and_stays_together(robot):
    plant = MujocoPlant(robot)
    plant.command_gripper(0.0)
    openings = []
    for _ in range(600):
        plant.step(robot.gravity(plant.state.q))
        openings.append(plant.gripper.opening)
    speed = -np.diff(openings) / plant.dt
    assert speed.max() < 2 * 0.06 * 1.1
    assert openings[-1] == pytest.approx(0.0, abs=2e-4)
    assert not plant.gripper.moving
    driven, follower = (plant.data.joint(j).qpos[0] for j in ("gripper", "left_finger_joint"))
    assert driven == pytest.approx(follower, abs=1e-4)
    plant.command_gripper(0.03)
    hold_still(plant, 0.5)
    assert plant.gripper.opening == pytest.approx(0.03, abs=2e-4)
    assert abs(plant.gripper.effort) < 1.0


@pytest.mark.parametrize(
    ("shape", "width", "mass"),
    [
        ("cylinder", 0.03, 0.06),
        ("cube", 0.04, 0.06),
        ("bottle", 0.035, 0.03),
        ("cylinder", 0.02, 0.01),
    ],
)
def test_what_it_grips_is_lifted_and_held(robot, shape, width, mass):
    height = width if shape == "cube" else 0.06
    body = Body(
        "it", shape, width, height, mass, COLOURS["red"], *AHEAD, yaw=np.arctan2(0.05, 0.19)
    )
    plant, controller = MujocoPlant(robot, World(bodies=(body,))), MpcController(robot)
    low = above(robot, max(min(height / 2, 0.03), 0.02))
    plant.reset(at(low))
    plant.command_gripper(0.0)
    drive(plant, controller, low, 0.7)
    assert plant.gripper.opening == pytest.approx(width, abs=1.5e-3)
    assert plant.gripper.effort == pytest.approx(20.0, abs=0.5)
    high = above(robot, 0.10, near=low)
    drive(plant, controller, high, 1.0)
    before = held_at(plant)
    drive(plant, controller, high, 2.0)
    assert plant.body_pose("it")[2, 3] > -0.11 + height / 2 + 0.05
    np.testing.assert_allclose(held_at(plant), before, atol=2e-4)
    plant.command_gripper(0.05)
    drive(plant, controller, high, 0.6)
    assert plant.body_pose("it")[2, 3] < -0.11 + 0.031


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_any_scattered_object_can_be_gripped_and_lifted(robot, seed):
    (body,) = scatter(np.random.default_rng(seed), 1)
    plant = MujocoPlant(robot, World(bodies=(body,)))
    height = max(min(body.height_m / 2, 0.035), 0.02)
    grip = above(robot, height, (body.x, body.y), near=[0.0, 1.5, -1.5])
    pitch = grip[1] + grip[2]
    away = -0.06 * np.cos(pitch)
    back = (body.x + away * np.cos(grip[0]), body.y + away * np.sin(grip[0]))
    before = above(robot, height - 0.06 * np.sin(pitch), back, near=grip)
    high = above(robot, height + 0.06, (0.95 * body.x, 0.95 * body.y), near=grip)
    plant.reset(at(before))
    start = plant.body_pose(body.name)[2, 3]
    ramp(plant, MpcController(robot), before, grip, 0.8)
    plant.command_gripper(0.0)
    drive(plant, MpcController(robot), grip, 0.7)
    loaded = MpcController(robot.with_payload(body.mass))
    ramp(plant, loaded, grip, high, 0.6)
    drive(plant, loaded, high, 2.5)  # what the table bore at first has to be unlearnt
    assert plant.body_pose(body.name)[2, 3] > start + 0.05
    np.testing.assert_allclose(plant.state.q, high, atol=2e-3)


def ramp(plant, controller, start, end, duration):
    """Move on a straight line in joint space, and wait a little at its end."""
    for share in np.linspace(0.1, 1.0, 10):
        drive(plant, controller, start + share * (end - start), duration / 10)
    drive(plant, controller, end, 0.3)


def held_at(plant):
    tool = plant.robot.placement(plant.state.q).homogeneous
    return (np.linalg.inv(tool) @ plant.body_pose("it"))[:3, 3]


def test_objects_stand_where_they_were_put(robot):
    bodies = scatter(np.random.default_rng(4), 9)
    plant = MujocoPlant(robot, World(bodies=bodies))
    plant.reset(at([0.0, 1.6, -0.5]))
    hold_still(plant, 1.0)
    for body in bodies:
        pose = plant.body_pose(body.name)
        wanted = [body.x, body.y, -0.11 + body.height_m / 2]
        np.testing.assert_allclose(pose[:3, 3], wanted, atol=2e-4)
        assert pose[2, 2] > 0.9999
        assert np.arctan2(pose[1, 0], pose[0, 0]) == pytest.approx(body.yaw, abs=1e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_pushed_slides_as_far_as_coulomb_says(robot, shape):
    body = Body("it", shape, 0.04, 0.04 if shape == "cube" else 0.02, 0.03, (1, 0, 0), 0.2, 0.0)
    plant = MujocoPlant(robot, World(bodies=(body,), friction=0.4), dt=0.002)
    plant.reset(at([2.2, 1.6, -0.5]))
    hold_still(plant, 0.1)
    plant.data.joint("it").qvel[0] = 0.5
    hold_still(plant, 0.6)
    far = 0.5**2 / (2 * 0.4 * 9.81)
    assert plant.body_pose("it")[0, 3] - 0.2 == pytest.approx(far, rel=0.03)


def test_what_falls_into_a_bin_stays_in_it(robot):
    tray = Bin("red", *AHEAD, (0.04, 0.04), COLOURS["red"])
    body = Body("it", "cylinder", 0.03, 0.05, 0.03, COLOURS["red"], *AHEAD)
    plant = MujocoPlant(robot, World(bodies=(body,), bins=(tray,)))
    plant.reset(at([0.0, 1.6, -0.5]))
    plant.data.joint("it").qpos[2] += 0.05
    plant.data.joint("it").qvel[:2] = 0.2
    hold_still(plant, 1.5)
    x, y, z = plant.body_pose("it")[:3, 3]
    assert tray.holds(x, y)
    assert z < -0.11 + 0.03


def test_an_arm_that_sweeps_knocks_over_what_stands_in_its_way(robot):
    plant = MujocoPlant(robot, World(bodies=(CAN,)))
    start = above(robot, 0.03) - [1.0, 0.0, 0.0]
    plant.reset(at(start))
    drive(plant, MpcController(robot), start + np.array([1.5, 0.0, 0.0]), 2.0)
    moved = plant.body_pose("can")[:2, 3] - AHEAD
    assert np.linalg.norm(moved) > 0.02
