"""Encoders that err by 0.1 deg, masses that are 30 % wrong: how still the arm stands, and why."""

import numpy as np

import arm3dof
from arm3dof.model.uncertainty import perturbed
from arm3dof.sim.disturbance import DisturbedPlant

robot = arm3dof.load_robot("arm3dof")
true_arm = perturbed(robot, 30, rng=np.random.default_rng(1))
target = np.deg2rad([28.1, 67.8, 53.8])


class OneReading:
    """A controller behind a bus that tells it one measurement a step."""

    def __init__(self, controller):
        self.dt, self.step, self.reset = controller.dt, controller.step, controller.reset


def run(measurement_noise, every_reading):
    """Return a run, and the noise that the controller believed in at its end [rad]."""
    plant = DisturbedPlant(
        arm3dof.PinocchioPlant(true_arm), noise=np.deg2rad(0.1), rng=np.random.default_rng(2)
    )
    plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
    settings = arm3dof.MpcSettings(measurement_noise=measurement_noise)
    controller = arm3dof.MpcController(robot, settings)
    asked = controller if every_reading else OneReading(controller)
    recording = arm3dof.run_loop(plant, asked, target, 4.0)
    return recording, controller.observer.filter.noise


for name, measurement_noise, every_reading in (
    ("measurements believed", 0.0, False),
    ("filtered, one reading a step", None, False),
    ("filtered, every reading", None, True),
):
    recording, noise = run(measurement_noise, every_reading)
    late = recording.t > 2.0
    fastest = np.abs(recording.v[late]).max()
    farthest = np.rad2deg(np.abs(recording.e[late]).max())
    print(
        f"{name:28}: after 2 s up to {fastest:.3f} rad/s and {farthest:.2f} deg; "
        f"believed noise {np.rad2deg(noise).mean():.3f} deg"
    )
