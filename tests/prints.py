"""Prints of chessboards and markers as a known, distorted camera sees them."""

from functools import cache

import cv2
import numpy as np

from arm3dof.vision.camera import Camera, intrinsics

MATRIX = intrinsics(610.0, 605.0, 325.0, 236.0)
DISTORTION = np.array([-0.22, 0.08, 0.001, -0.0008, 0.0])
COLUMNS, ROWS, SQUARE = 9, 6, 0.02
CAMERA = Camera(640, 480, MATRIX, DISTORTION, np.eye(4))


@cache
def all_rays(camera):
    """The rays of all pixels, four a pixel."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    steps = [(du, dv) for du in (-0.25, 0.25) for dv in (-0.25, 0.25)]
    return [camera.rays(np.column_stack([(u + x).ravel(), (v + y).ravel()])) for x, y in steps]


def print_of(pattern, size, camera, transform):
    """Photograph a print: a grey picture that measures ``size`` [m] about the origin of its frame.

    Every pixel's ray is followed to the print's plane.
    """
    inverse = np.linalg.inv(transform)  # camera to print
    shots = []
    for rays in all_rays(camera):
        towards = rays @ inverse[:3, :3].T
        place = inverse[:3, 3] - towards * (inverse[2, 3] / towards[:, 2:])
        x = (place[:, 0] / size[0] + 0.5) * pattern.shape[1] - 0.5
        y = (0.5 - place[:, 1] / size[1]) * pattern.shape[0] - 0.5
        maps = [it.reshape(camera.height, camera.width).astype(np.float32) for it in (x, y)]
        shots.append(cv2.remap(pattern, *maps, cv2.INTER_LINEAR, borderValue=150).astype(float))
    grey = cv2.GaussianBlur(np.mean(shots, axis=0), (3, 3), 0.6)
    return np.dstack([np.rint(grey).astype(np.uint8)] * 3)


def chess():
    cells = (np.add.outer(np.arange(ROWS + 1), np.arange(COLUMNS + 1)) % 2).astype(np.uint8)
    board = np.kron(220 - 190 * cells, np.ones((24, 24), np.uint8)).astype(np.uint8)
    board = cv2.copyMakeBorder(board, 24, 24, 24, 24, cv2.BORDER_CONSTANT, value=235)
    return board, ((COLUMNS + 3) * SQUARE, (ROWS + 3) * SQUARE)


def held(rng, tilt=0.6, spread=0.05):
    """A board before the camera, turned and tilted; takes its frame to the camera's."""
    turn, _ = cv2.Rodrigues(np.array([*rng.uniform(-tilt, tilt, 2), rng.uniform(-0.2, 0.2)]))
    transform = np.eye(4)
    transform[:3, :3] = turn @ np.diag([1.0, -1, -1])  # it faces the camera
    transform[:3, 3] = [*rng.uniform(-spread, spread, 2), rng.uniform(0.3, 0.42)]
    return transform
