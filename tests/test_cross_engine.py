"""Two engines, one arm: MuJoCo's world and Pinocchio's model have the same dynamics."""

import mujoco
import numpy as np
import pytest
from arm_family import random_arm

from arm3dof.model.gripper import find_gripper, with_free_gripper
from arm3dof.model.library import load_robot
from arm3dof.sim.mujoco_arm import set_inertias
from arm3dof.sim.mujoco_world import build_model
from arm3dof.sim.pinocchio_plant import PinocchioPlant
from arm3dof.sim.world import World
from arm3dof.state import JointState

LIBRARY = ("ur5", "panda", "so101")
ARM_ALONE = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_LIMIT
    | mujoco.mjtDisableBit.mjDSBL_EQUALITY
    | mujoco.mjtDisableBit.mjDSBL_ACTUATION
)


def reference():
    robot = load_robot("arm3dof")
    return with_free_gripper(robot, find_gripper(robot))


def without_friction(name):
    bare = load_robot(name)
    none = {
        f"{joint}.{kind}": 0.0 for joint in bare.joint_names for kind in ("damping", "friction")
    }
    return load_robot(name, overrides=none)


ROBOTS = {
    "gripper free": reference,
    "gripper held": lambda: load_robot("arm3dof"),
    "payload": lambda: load_robot("arm3dof").with_payload(0.15, (0.01, 0.02, -0.03)),
    **{
        f"random arm {seed}": lambda seed=seed: (
            random_arm(np.random.default_rng(seed), upright=seed % 2 == 0).robot
        )
        for seed in range(6)
    },
    **{name: lambda name=name: without_friction(name) for name in LIBRARY},
}
NAMES = [pytest.param(name, marks=[pytest.mark.slow] if name in LIBRARY else []) for name in ROBOTS]


class Twin:
    """A robot's MuJoCo model without anything about it, addressed in the robot's joint order."""

    def __init__(self, robot, timestep=0.001):
        gripper = find_gripper(load_robot("arm3dof")) if "gripper" in robot.joint_names else None
        self.model = build_model(robot, gripper, World(), timestep)
        self.model.opt.disableflags |= ARM_ALONE
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self.q_at = [joint.qposadr[0] for joint in joints]
        self.v_at = [joint.dofadr[0] for joint in joints]

    def place(self, q, v):
        self.data.qpos[self.q_at], self.data.qvel[self.v_at] = q, v
        mujoco.mj_forward(self.model, self.data)

    def mass_matrix(self):
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.v_at, self.v_at)]

    def bias(self):
        return self.data.qfrc_bias[self.v_at].copy()


def draw(robot, rng):
    span = np.minimum(robot.limits.v_max, 5.0)
    return robot.random_configuration(rng), rng.uniform(-1.0, 1.0, robot.nv) * span


@pytest.mark.parametrize("name", NAMES)
def test_mass_matrix_and_bias_are_pinocchios(name):
    robot, rng = ROBOTS[name](), np.random.default_rng(1)
    twin = Twin(robot)
    for _ in range(100):
        q, v = draw(robot, rng)
        twin.place(q, v)
        assert np.abs(twin.mass_matrix() - robot.mass_matrix(q)).max() < 1e-12
        bias = robot.coriolis(q, v) @ v + robot.gravity(q)
        assert np.abs(twin.bias() - bias).max() < 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_one_second_under_torque_is_pinocchios(name):
    robot, rng = ROBOTS[name](), np.random.default_rng(2)
    twin, plant = Twin(robot), PinocchioPlant(robot, dt=0.001)
    low, high = robot.limits.q_min, robot.limits.q_max
    middle = np.where(np.isfinite(low), (low + high) / 2, 0.0)
    q = middle + 0.2 * (robot.random_configuration(rng) - middle)
    plant.reset(JointState(0.0, q, np.zeros(robot.nv)))
    twin.place(q, np.zeros(robot.nv))
    push = robot.mass_matrix(q) @ rng.uniform(-3.0, 3.0, robot.nv)  # so many rad/s^2 at first
    for step in range(1000):
        tau = robot.gravity(plant.state.q) + push * np.sin(0.01 * step)
        plant.step(tau)
        twin.data.qfrc_applied[twin.v_at] = tau
        mujoco.mj_step(twin.model, twin.data)
    assert np.abs(plant.state.q - q).max() > 1e-3
    assert np.abs(twin.data.qpos[twin.q_at] - plant.state.q).max() < 1e-9
    assert np.abs(twin.data.qvel[twin.v_at] - plant.state.v).max() < 1e-8


def test_a_changed_robot_is_as_one_that_was_built():
    robot = load_robot("arm3dof")
    twin, rng = Twin(robot), np.random.default_rng(3)
    loaded = robot.with_payload(0.2, (0.02, -0.01, 0.03))
    set_inertias(twin.model, loaded)
    for _ in range(20):
        q, v = draw(robot, rng)
        twin.place(q, v)
        np.testing.assert_allclose(twin.mass_matrix(), loaded.mass_matrix(q), atol=1e-14)
        bias = loaded.coriolis(q, v) @ v + loaded.gravity(q)
        np.testing.assert_allclose(twin.bias(), bias, atol=1e-12)
