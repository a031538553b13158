"""Two things of one colour in one patch of the picture."""

import cv2
import numpy as np
import pytest

from arm3dof.runtime.tasks.simulated import task_camera
from arm3dof.vision.overlap import neck, stand_both
from arm3dof.vision.upright import KINDS, across, upright

TABLE = -0.11
CAMERA = task_camera()
FINE = 8  # of a pixel, in which patches are drawn


def patch(solids, states):
    """Return the outline of the union of silhouettes, shape (n, 2) [px]; None when it is in two."""
    corner = np.array([CAMERA.width, CAMERA.height]) / 4  # the middle of the picture is enough
    shape = (CAMERA.height * FINE // 2, CAMERA.width * FINE // 2)
    canvas = np.zeros(shape, np.uint8)
    for solid, state in zip(solids, states, strict=True):
        for body, _ in solid(state):
            seen = body[:, :2] / body[:, 2:] * CAMERA.focal_px + CAMERA.camera_matrix[:2, 2]
            hull = cv2.convexHull(((seen - corner) * FINE).astype(np.float32))
            cv2.fillConvexPoly(canvas, np.rint(hull).astype(np.int32), 255)
    found, _ = cv2.findContours(canvas, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return found[0].reshape(-1, 2)[:: FINE // 2] / FINE + corner if len(found) == 1 else None


def random_pair(rng):
    """Draw a thing and another one behind it, of any two shapes, that overlap in the picture."""
    while True:
        kinds = rng.choice(KINDS, 2)
        x, y = 0.18 + rng.uniform(-0.03, 0.03), rng.uniform(-0.04, 0.04)
        states = []
        for kind in kinds:
            width = rng.uniform(0.02, 0.04) / (np.sqrt(2) if kind == "box" else 1)
            turn = [rng.uniform(0, np.pi)] if kind == "box" else []
            states.append(np.array([x, y, width, rng.uniform(0.03, 0.06), *turn]))
            away, aside = rng.uniform(0.04, 0.07), rng.uniform(-1, 1)
            x, y = x - away * np.cos(aside), y + away * np.sin(aside)
        outline = patch([upright(kind, CAMERA, TABLE) for kind in kinds], states)
        if outline is not None:
            return kinds, states, outline


def noisy(contour, rng):
    return contour + rng.normal(0, 0.1, contour.shape)


def cut_off(contour, rng):
    """Return what a straight edge before it leaves of a patch."""
    axis, side = rng.integers(2), rng.choice([-1, 1])
    seen = contour[:, axis] * side
    cut = contour.copy()
    cut[:, axis] = np.minimum(seen, seen.min() + rng.uniform(0.2, 0.9) * np.ptp(seen)) * side
    return cut


def test_both_things_of_a_pair_are_found():
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(30):
        kinds, states, contour = random_pair(rng)
        both = stand_both("red", noisy(contour, rng), contour, CAMERA, TABLE)
        if both is None:
            continue
        found += 1
        near, far = both
        assert not near.hidden
        assert near.distance_to(*states[0][:2]) < 5e-4
        assert near.width_m == pytest.approx(across(kinds[0], states[0]), abs=5e-4)
        assert far.hidden
        assert far.distance_to(*states[1][:2]) < 0.01
    assert found >= 28


def test_a_single_thing_is_no_pair():
    rng = np.random.default_rng(1)
    for _ in range(30):
        kinds, states, _ = random_pair(rng)
        contour = patch([upright(kinds[0], CAMERA, TABLE)], states[:1])
        for seen in (contour, cut_off(contour, rng)):
            assert stand_both("red", noisy(seen, rng), seen, CAMERA, TABLE) is None


def test_a_pair_that_is_cut_off_is_not_mismeasured():
    rng = np.random.default_rng(2)
    for _ in range(30):
        _, states, contour = random_pair(rng)
        cut = cut_off(contour, rng)
        for thing in stand_both("red", noisy(cut, rng), cut, CAMERA, TABLE) or ():
            assert thing.hidden or thing.distance_to(*states[0][:2]) < 1e-3


def test_a_neck_is_the_narrowest_place():
    turn = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    assert neck(50 * ring) is None
    canvas = np.zeros((200, 300), np.uint8)
    for x in (100, 170):
        cv2.circle(canvas, (x, 100), 40, 255, -1)
    ((contour),) = cv2.findContours(canvas, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    ends = neck(contour.reshape(-1, 2))
    across_it = np.sqrt(40**2 - 35**2)
    np.testing.assert_allclose(sorted(ends[:, 1]), [100 - across_it, 100 + across_it], atol=2)
    np.testing.assert_allclose(ends[:, 0], 135, atol=2)
