"""Grasp one of three objects, lift it and put it down: pixels in, torques out, in MuJoCo.

Run it with ``python examples/17_grasp.py [SEED]``; it needs the extra ``physics``.
"""

import sys

import numpy as np

import arm3dof
from arm3dof.runtime.tasks.goals import Grasping
from arm3dof.runtime.tasks.scenes import three_objects
from arm3dof.runtime.tasks.simulated import SimulatedTask, task_targets

seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
rng = np.random.default_rng(seed)
robot = arm3dof.load_robot("arm3dof")
task = three_objects(robot, rng, "green", ("green", "red", "blue"))
body = task.body
print(f"a {body.shape} of {1000 * body.mass:.0f} g at ({body.x:.3f}, {body.y:.3f}) m is wanted at "
      f"({task.place[0]:.3f}, {task.place[1]:.3f}) m")  # fmt: skip

with SimulatedTask(robot, task.world, task_targets(), rng) as scene:
    result = scene.run(Grasping(task.target, task.place, payload=body.mass))
    for step in result.steps:
        print(f"{step.t:6.2f} s  {step.source:9} {step.reason}")
    verdict = scene.verdict(body.name)
miss = 1000 * verdict.misses(*task.place)
print(f"lifted {1000 * verdict.lifted:.0f} mm, put down {miss:.1f} mm from its place")
