"""Put MPC and classical controllers through the same move, without and with a load."""

import numpy as np

import arm3dof
from arm3dof.runtime.compare import ENTRANTS, compare
from arm3dof.runtime.scenarios import scenario_set

robot = arm3dof.load_robot("arm3dof")

# One move without and one with a payload of 0.1 kg that no controller is told of. The whole set,
# with a figure: arm3dof compare --scenarios full --out out/compare
paper, payload = scenario_set(robot)[0], scenario_set(robot)[4]
comparison = compare(robot, [paper, payload], ["mpc-tracking", "computed-torque", "pd-gravity"])
for condition in comparison.conditions:
    print(condition)
    for row in comparison.table(condition):
        error, final = np.rad2deg([row.rms_error, row.final_error])
        print(
            f"  {ENTRANTS[row.controller].label:16} RMS error {error:5.2f} deg, "
            f"at the end {final:6.3f} deg, {row.energy:.2f} J"
        )
