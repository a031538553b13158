"""Choose weights: what speed costs in energy, and where paying more buys nothing."""

import tempfile
from pathlib import Path

import numpy as np

import arm3dof
from arm3dof.runtime.sweep import Vary, points, sweep

robot = arm3dof.load_robot("arm3dof")

# Two settings, a grid of runs. With more than one core, say workers=2 or more.
grid = points([Vary.parse("input_weight=1e-5:1e-2:4"), Vary.parse("velocity_weight=0,0.01")])
table = Path(tempfile.mkdtemp(prefix="arm3dof-")) / "sweep.csv"
result = sweep(robot, grid, duration=3.0, table=table)

on_front = result.front("energy_j", "settling_time_s")
print("velocity_weight   input_weight   settling    energy")
for outcome, best in zip(result.outcomes, on_front, strict=True):
    settling, energy = outcome.values["settling_time_s"], outcome.values["energy_j"]
    family = outcome.point.family.removeprefix("velocity_weight = ")
    mark = "   no run is faster for less" if best else ""
    print(f"{family:>15}   {outcome.point.label:>12}   {settling:6.2f} s   {energy:.3f} J{mark}")

# The table keeps what was run: a second call runs nothing again.
print("taken from the table:", sweep(robot, grid, duration=3.0, table=table).reused)

# Or name the time that a move should take, and let the weights follow from it.
for wish in (0.5, 1.0, 2.0):
    settings = arm3dof.MpcSettings.tuned(settling_time=wish)
    weight, stages = float(np.asarray(settings.input_weight)), settings.horizon
    print(f"tuned({wish}): dt = {settings.dt:.3f} s, horizon {stages}, input_weight {weight:.1e}")
