"""A table in physics: grip a can, lift it, and film it with a camera that stands in that world."""

import cv2
import numpy as np

import arm3dof
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.world import COLOURS, Bin, Body, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.ui.video import write_mp4
from arm3dof.vision.camera import intrinsics, look_at

robot = arm3dof.load_robot("arm3dof")
can = Body("can", "cylinder", 0.03, 0.06, 0.040, COLOURS["red"], x=0.19, y=0.06)
cube = Body("cube", "cube", 0.025, 0.025, 0.020, COLOURS["green"], x=0.21, y=-0.05, yaw=0.4)
tray = Bin("red", x=0.02, y=-0.19, half_size=(0.045, 0.045), colour=COLOURS["red"])
plant = MujocoPlant(robot, World(bodies=(can, cube), bins=(tray,)))
controller = arm3dof.MpcController(robot)


def reach(height, near=None):
    """Return joint angles with the tool at the can, so far above the table."""
    return arm3dof.inverse_kinematics(robot, [can.x, can.y, -0.11 + height], near=near).best


low, high = reach(0.03), reach(0.10, near=reach(0.03))
frames = []


def move(target, duration):
    """Drive the arm to joint angles, and take 20 pictures a second."""
    hold = round(controller.dt / plant.dt)
    for step in range(round(duration / plant.dt)):
        if step % hold == 0:
            tau = controller.step(plant.measure(), target).tau
            frames.append(camera.take())
        plant.step(tau)


plant.reset(arm3dof.JointState(0.0, low, np.zeros(3)))
with WorldCamera(
    plant,
    intrinsics(460.0, 460.0, 239.5, 179.5),
    look_at([0.50, 0.30, 0.14], [0.12, -0.01, -0.05]),
    480,
    360,
    shadows=False,
    noise=2.0,
    rng=np.random.default_rng(0),
) as camera:
    plant.command_gripper(0.0)
    move(low, 0.7)
    print(f"the pads stand {1e3 * plant.gripper.opening:.1f} mm apart, "
          f"and each presses with {plant.gripper.effort / 2:.0f} N")  # fmt: skip
    controller = arm3dof.MpcController(robot.with_payload(can.mass))  # it knows what it carries
    move(high, 1.0)
    print(f"the can is {1e3 * (plant.body_pose('can')[2, 3] + 0.08):.0f} mm up")
cv2.imwrite("lifted.png", frames[-1])
print(f"wrote {write_mp4('lift.mp4', frames, 20.0)} and lifted.png")
