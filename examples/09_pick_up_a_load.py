"""Pick up a load that nobody announced: the controller weighs it, and carries it to the target."""

import numpy as np

import arm3dof
from arm3dof.sim.disturbance import DisturbedPlant, PayloadChange

robot = arm3dof.load_robot("arm3dof")
target = np.deg2rad([28.1, 67.8, 53.8])
changes = [PayloadChange(1.5, mass=0.1), PayloadChange(3.5, mass=None)]  # [s], [kg]


def run(observer_gain):
    """Return a run with a pick-up and a release, and the load that the controller believed in."""
    plant = DisturbedPlant(arm3dof.PinocchioPlant(robot), payloads=changes)
    plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
    controller = arm3dof.MpcController(robot, arm3dof.MpcSettings(observer_gain=observer_gain))
    weighed = []

    def weigh(state, step):
        weighed.append(controller.observer.estimator.load)

    return arm3dof.run_loop(plant, controller, target, 5.5, [weigh]), weighed


learning, weighed = run(observer_gain=0.5)  # the default
without, _ = run(observer_gain=0.0)
print(" time   weighed   largest error, learning and not")
for t in (1.4, 1.7, 2.0, 2.5, 3.4, 3.7, 4.0, 5.0):
    errors = [np.rad2deg(np.abs(r.e[round(1000 * t)]).max()) for r in (learning, without)]
    grams = 1000 * weighed[round(t / learning.control_dt)]
    print(f"{t:4.1f} s   {grams:5.1f} g   {errors[0]:8.2f} deg {errors[1]:8.2f} deg")

# What is known beforehand need not be learned: give the controller the loaded robot.
loaded = robot.with_payload(0.1)
plant = arm3dof.PinocchioPlant(loaded)
plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
recording = arm3dof.run_loop(plant, arm3dof.MpcController(loaded), target, 3.0)
print(f"announced: settled after {arm3dof.summarise(recording).settling_time:.2f} s")
