"""Ask for every way in which the arm reaches a point, and why it does not reach another."""

import numpy as np

import arm3dof

robot = arm3dof.load_robot("arm3dof")

reach = arm3dof.inverse_kinematics(robot, [0.12, 0.05, 0.08])
print(reach.sentence)
for branch, q, inside in zip(reach.branches, reach.solutions, reach.within_limits, strict=True):
    hand = robot.placement(q).translation
    verdict = "inside" if inside else "outside"
    print(f"  {branch:17} {np.rad2deg(q).round(1)} deg, {verdict} the limits, hand at {hand}")

# An answer that is no is a value with a reason, not an exception.
far = arm3dof.inverse_kinematics(robot, [0.30, 0.00, 0.05])
print(far.sentence)
print("  reason:", far.reason, " nearest point:", far.nearest.round(4))
