"""Torques that act 50 ms late: the controller looks ahead over a delay that it is told of."""

import numpy as np

import arm3dof
from arm3dof.sim.disturbance import DisturbedPlant

robot = arm3dof.load_robot("arm3dof")
target = np.deg2rad([28.1, 67.8, 53.8])


def run(true_delay, declared_delay):
    """Return what a run achieves when commands act late, and the controller is told so."""
    plant = DisturbedPlant(arm3dof.PinocchioPlant(robot), delay=true_delay)
    plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
    settings = arm3dof.MpcSettings(input_weight=1e-3, delay=declared_delay)
    recording = arm3dof.run_loop(plant, arm3dof.MpcController(robot, settings), target, 3.0)
    return arm3dof.summarise(recording)


for true_delay, declared_delay in ((0.0, 0.0), (0.05, 0.05), (0.05, 0.04), (0.05, 0.0)):
    metrics = run(true_delay, declared_delay)
    said = f"delay {1000 * true_delay:2.0f} ms, declared {1000 * declared_delay:2.0f} ms"
    if metrics.settled:
        print(f"{said}: settled after {metrics.settling_time:.2f} s")
    else:
        print(f"{said}: not settled, {np.rad2deg(metrics.final_error):.0f} deg off at the end")
