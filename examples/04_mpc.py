"""Drive the arm to the paper's target with model predictive control, one step at a time."""

import numpy as np

import arm3dof

robot = arm3dof.load_robot("arm3dof")
controller = arm3dof.MpcController(robot, arm3dof.MpcSettings(horizon=20, dt=0.05))
plant = arm3dof.PinocchioPlant(robot, dt=0.001)
target = np.deg2rad([28.1, 67.8, 53.8])

# The loop, written out: state in, torque out, and the torque is held for one sampling time.
state = plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
for _ in range(10):
    step = controller.step(state, target)
    for _ in range(50):
        state = plant.step(step.tau)
    error = np.rad2deg(target - state.q)
    print(f"t = {state.t:.2f} s  error {error.round(1)} deg  torque {step.tau.round(2)} N m")
print("the last step:", step.status.sentence)

# The same as one call, with everything recorded.
plant.reset(arm3dof.JointState(0.0, np.zeros(3), np.zeros(3)))
controller.reset()
recording = arm3dof.run_loop(plant, controller, target, duration=4.0)
metrics = arm3dof.summarise(recording)
print(f"settled: {metrics.settled}, after {metrics.settling_time:.2f} s")
print(f"peak torque {metrics.peak_torque:.2f} of {metrics.torque_limit:.2f} N m")
