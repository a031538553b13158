"""Draw a circle in the air: the controller sees the path coming, and does not lag behind."""

import numpy as np

import arm3dof

robot = arm3dof.load_robot("arm3dof")

# A circle of 6 cm radius in front of the arm, once round in 2.5 s, at rest at both ends.
share = np.linspace(0.0, 1.0, 61)
angle = 2 * np.pi * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
circle = np.stack([0.17 + 0 * angle, 0.06 * np.cos(angle), 0.06 + 0.06 * np.sin(angle)], axis=1)

# Inverse kinematics makes it a trajectory of the joints, on one branch from end to end.
trajectory = arm3dof.cartesian_path(robot, circle, times=2.5 * share)

# A fast tuning: the smaller the input weight, the closer it follows.
controller = arm3dof.MpcController(robot, arm3dof.MpcSettings(input_weight=1e-5))
plant = arm3dof.PinocchioPlant(robot)
plant.reset(arm3dof.JointState(0.0, trajectory.q[0], np.zeros(3)))
recording = arm3dof.run_loop(plant, controller, trajectory, duration=3.0)


def tool(q):
    """Return where the tool is [mm]."""
    return 1000 * robot.placement(q).translation


for row in range(0, 3000, 250):
    is_at, q = recording.t[row], recording.q[row]
    should_be = q + recording.e[row]
    miss = np.linalg.norm(tool(q) - tool(should_be))
    print(f"t = {is_at:.2f} s  tool {tool(q).round(1)} mm, off by {miss:.2f} mm")

# A path that leaves the workspace is refused, and the message says where.
try:
    arm3dof.cartesian_path(robot, 2 * circle, times=2.5 * share)
except arm3dof.InputError as error:
    print("refused:", error)
