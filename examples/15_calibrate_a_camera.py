"""Find a lens from views of a chessboard, and a pose from points at known places."""

import cv2
import numpy as np

from arm3dof.vision.camera import Camera, intrinsics, look_at
from arm3dof.vision.chessboard import board_points, calibrate_lens
from arm3dof.vision.pose import calibrate_pose

rng = np.random.default_rng(0)
pose = look_at([0.06, 0.30, 0.17], [0.175, -0.035, -0.09])
lens = np.array([-0.2, 0.06, 0.0, 0.0, 0.0])
true = Camera(640, 480, intrinsics(612.0, 611.0, 322.0, 238.0), lens, pose)

# Corners of a board before the camera; board_corners(picture, 9, 6) finds them in a photograph.
board = board_points(9, 6, square_m=0.02)
views = []
for _ in range(12):
    turn, _ = cv2.Rodrigues(rng.uniform(-0.6, 0.6, 3))
    held = board @ turn.T + [*rng.uniform(-0.05, 0.05, 2), rng.uniform(0.3, 0.4)]
    seen = true.project(true.to_base(held))
    views.append(seen + rng.normal(0, 0.1, seen.shape))

found = calibrate_lens(views, board, 640, 480)
print(f"focal length {found.camera_matrix[0, 0]:.1f} px, give or take {found.focal_sigma_px:.1f}")
print(f"corners off by {found.rms_px:.2f} px; to be trusted: {found.good}")
few = calibrate_lens(views[:3], board, 640, 480)
print("three views:", few.troubles[0].value)

# The tool was moved to eight known places, and seen there; a marker on the table does as well.
camera = Camera(640, 480, found.camera_matrix, found.distortion, np.eye(4))
places = rng.uniform([0.10, -0.12, -0.09], [0.22, 0.08, 0.08], (8, 3))
pixels = true.project(places) + rng.normal(0, 0.5, (8, 2))
stands = calibrate_pose(places, pixels, camera)
print("the camera stands at", np.round(100 * stands.transform_base_camera[:3, 3], 1), "cm")
print(
    f"give or take {1000 * stands.position_sigma_m:.1f} mm and "
    f"{np.rad2deg(stands.rotation_sigma_rad):.2f} degrees; to be trusted: {stands.good}"
)
placed = stands.applied(camera)  # what is located with it knows of these doubts
print(placed.doubt)
