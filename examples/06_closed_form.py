"""The paper's hand-derived dynamics beside Pinocchio's, number by number and in speed."""

import time

import numpy as np

import arm3dof

robot = arm3dof.load_robot("arm3dof")
form = arm3dof.ClosedForm.from_robot(robot)
print("link masses [kg]:", form.masses)
print("lengths [m]:", form.a2, form.a3)

q, v = np.deg2rad([20.0, 40.0, -30.0]), np.array([1.0, -2.0, 3.0])
np.set_printoptions(precision=6, suppress=True)
print("M(q) in closed form:\n", form.mass_matrix(q), sep="")
print("differs from Pinocchio by", np.abs(form.mass_matrix(q) - robot.mass_matrix(q)).max())
coriolis = form.coriolis(q, v) @ v
print("C(q, v) v:", coriolis, "differs by", np.abs(coriolis - robot.coriolis(q, v) @ v).max())
print("g(q):", form.gravity(q), "differs by", np.abs(form.gravity(q) - robot.gravity(q)).max())

# The closed form takes whole batches of states at once.
rng = np.random.default_rng(0)
many = np.array([robot.random_configuration(rng) for _ in range(10_000)])
start = time.perf_counter()
form.mass_matrix(many)
print(f"10,000 mass matrices in {1e3 * (time.perf_counter() - start):.1f} ms")
