"""Load a robot, change its parameters, and see what it is made of."""

import numpy as np

import arm3dof

robot = arm3dof.load_robot("arm3dof")
print(robot)
for joint, name in enumerate(robot.joint_names):
    low, high = np.rad2deg([robot.limits.q_min[joint], robot.limits.q_max[joint]])
    torque = robot.limits.tau_max[joint]
    print(f"  {name}: {low:.0f} to {high:.0f} deg, at most {torque:.2f} N m")

# The URDF's numbers are parameters: masses, lengths, centroids, inertias, limits, gravity.
loaded = arm3dof.load_robot("arm3dof", overrides={"link3.mass": 0.30, "gravity.z": -9.8})
stretched = np.zeros(3)
print("holding torque, stretched out [N m]:", np.round(robot.gravity(stretched), 3))
print("the same with a heavier forearm:    ", np.round(loaded.gravity(stretched), 3))

# A mistake is answered with what there is.
try:
    arm3dof.load_robot("arm3dof", overrides={"link3.mas": 0.20})
except arm3dof.InputError as error:
    print("error:", error)
