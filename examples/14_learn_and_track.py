"""Learn a colour from one click, then follow the thing from picture to picture."""

from dataclasses import replace

import numpy as np

from arm3dof.config.camera_file import load_camera
from arm3dof.sim.scene import Scene, draw
from arm3dof.sim.shapes import Cylinder
from arm3dof.sim.table import Table as DrawnTable
from arm3dof.vision.budget import Table
from arm3dof.vision.camera import Camera, Doubt
from arm3dof.vision.colour import ColourTarget
from arm3dof.vision.learn import learn_colour
from arm3dof.vision.locate import look
from arm3dof.vision.tracker import Tracker

HEIGHT = -0.11  # of the table [m]
SPEED = np.array([0.05, -0.03])  # of the thing [m/s]


def photograph(camera: Camera, t: float, rng: np.random.Generator) -> np.ndarray:
    """Draw an orange cylinder that slides over the table."""
    x, y = np.array([0.17, 0.02]) + SPEED * t
    thing = Cylinder((x, y, HEIGHT + 0.02), 0.015, 0.04, (0.9, 0.4, 0.05))
    scene = Scene((thing,), DrawnTable(height=HEIGHT))
    pose = camera.transform_base_camera
    return draw(scene, camera.camera_matrix, pose, camera.width, camera.height, rng)


rng = np.random.default_rng(0)
# A camera whose pose is known to 1 mm and 0.2 degrees
doubt = Doubt(position_m=0.001, rotation_rad=np.deg2rad(0.2))
camera = replace(load_camera("desk").camera, doubt=doubt)

# One click on the thing teaches its colour
first = photograph(camera, 0.0, rng)
u, v = np.rint(camera.project([0.17, 0.02, HEIGHT + 0.02])).astype(int)
learned = learn_colour(first, (u, v))
print(f"learned hues {learned.hsv.low[0]} to {learned.hsv.high[0]} from a click at ({u}, {v})")
target = ColourTarget("thing", learned.hsv, width_m=0.03, shape="cylinder")

tracker = Tracker()
for k in range(12):
    t = 0.1 * k
    view = look(photograph(camera, t, rng), camera, [target], table=Table(HEIGHT))
    tracks = tracker.update(view, t)
    if tracks and k % 3 == 2:
        x, y, z = 100 * tracks[0].p_base
        print(
            f"t = {t:.1f} s: ({x:.1f}, {y:.1f}, {z:.1f}) cm, +- {1000 * tracks[0].sigma_m:.1f} mm"
        )

verdict = view.located[0].judge(limit_m=0.008)
print(verdict.sentence)
print(
    "of that, in mm:", {it.name.lower(): round(1000 * s, 2) for it, s in verdict.by_cause.items()}
)
print("speed", np.round(100 * tracks[0].v_base, 1), "cm/s; true", 100 * SPEED)
