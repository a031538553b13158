"""Find a coloured object in a picture: in the picture, in the camera's frame, in the arm's."""

import tempfile
from pathlib import Path

import numpy as np

from arm3dof.config.camera_file import load_camera
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.vision.annotate import annotate
from arm3dof.vision.colour import ColourTarget, HsvRange
from arm3dof.vision.focal import focal_length
from arm3dof.vision.locate import look
from arm3dof.vision.sources import write_image

# A camera is a TOML file: intrinsics, pose, and the objects it knows. "paper" is a preset.
camera, targets = load_camera("paper")
print(f"camera at {camera.position} m; it knows: {', '.join(targets)}")

# A drawn picture stands in for a photograph; read_image("photo.png") reads one.
picture = draw_demo(camera, np.random.default_rng(5))

view = look(picture, camera, targets)
for seen in view.located:
    where = np.round(100 * seen.p_base, 1)
    sigma = 1000 * seen.sigma_m
    print(f"{seen.target:7} box {seen.box_px} -> {where} cm in the arm's frame, +- {sigma:.1f} mm")
for patch in view.refused:
    print(f"{patch.target:7} box {patch.box_px} is not measured: {patch.reason.value}")

# A target is a colour and a true width; red's hues wrap around 0.
red = ColourTarget("red", HsvRange((172, 120, 40), (6, 255, 255)), width_m=0.030)
print("the red thing:", [seen.p_base.round(3) for seen in look(picture, camera, [red]).located])

# The focal length comes from one picture of a known object, F = P D / W.
print("focal length:", focal_length(width_px=72.0, distance_m=0.25, width_m=0.03), "px")

path = Path(tempfile.mkdtemp(prefix="arm3dof-")) / "seen.png"
print("wrote", write_image(path, annotate(picture, view)))
