"""Sort nine objects of three colours into three bins, until the table is empty, in MuJoCo.

Run it with ``python examples/18_sort.py [SEED]``; it needs the extra ``physics`` and about half a
minute.
"""

import sys

import numpy as np

import arm3dof
from arm3dof.runtime.tasks.machine import Phase
from arm3dof.runtime.tasks.simulated import SimulatedTask, task_targets
from arm3dof.runtime.tasks.sort_trial import TIME_LIMIT, judge, random_table, sorting

seed = int(sys.argv[1]) if len(sys.argv) > 1 else 4
rng = np.random.default_rng(seed)
world = random_table(rng)
targets = task_targets([tray.name for tray in world.bins])
with SimulatedTask(arm3dof.load_robot("arm3dof"), world, targets, rng) as scene:
    result = scene.run(sorting(world), time_limit=TIME_LIMIT)
    verdicts = {body.name: scene.verdict(body.name) for body in world.bodies}

for step in result.steps:
    if step.source is Phase.DECIDE or step.target is Phase.RECOVER:
        print(f"{step.t:6.2f} s  {step.reason}")
judgement = judge(world, result, verdicts)
figures = judgement.figures
print(f"{figures['objects_sorted']} of {figures['objects_in_all']} objects are in their bins after "
      f"{result.duration:.0f} s: {judgement.sentence}")  # fmt: skip
