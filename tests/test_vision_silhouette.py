"""Solids against outlines that are drawn from their own geometry, and against things in the way."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from arm3dof.vision import silhouette
from arm3dof.vision.placing import Refusal, place

PIXEL = 1 / 600
UP = np.array([0.0, -0.8, -0.6])


def random_up(rng):
    pitch = rng.uniform(0.2, 1.1)
    return np.array([0.0, -math.cos(pitch), -math.sin(pitch)])


def outline(solid, state, rng, noise_px=0.1):
    """Points on the silhouette of a solid, found by casting rays from inside it."""
    parts = [body[:, :2] / body[:, 2:] for body, _ in solid(state)]
    middle = parts[0].mean(axis=0)
    angles = rng.uniform(0, 2 * math.pi, 160)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    farthest = np.zeros(len(rays))
    for part in parts:
        hull = part[ConvexHull(part).vertices]  # against the clock
        sides = np.roll(hull, -1, axis=0) - hull
        normals = np.column_stack([sides[:, 1], -sides[:, 0]])
        rise, gap = rays @ normals.T, ((hull - middle) * normals).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = gap / rise
        out = np.where(rise > 0, reach, np.inf).min(axis=1)
        into = np.where(rise < 0, reach, 0).max(axis=1)
        farthest = np.where(into < out, np.maximum(farthest, out), farthest)
    points = middle + farthest[:, None] * rays
    return points + rng.normal(0, noise_px * PIXEL, points.shape)


def lines_of_sight(points):
    return np.column_stack([points, np.ones(len(points))])


CASES = {
    "ball": lambda up, width, tall, turn: (silhouette.ball(width / 2), []),
    "cylinder": lambda up, width, tall, turn: (silhouette.cylinder(width / 2, up), [tall]),
    "bottle": lambda up, width, tall, turn: (silhouette.bottle(width / 2, up), [tall]),
    "cube": lambda up, width, tall, turn: (silhouette.cube(width, up), [turn]),
}


def random_case(rng, shape):
    up, width = random_up(rng), rng.uniform(0.02, 0.045)
    solid, more = CASES[shape](up, width, rng.uniform(0.9, 2) * width, rng.uniform(0, math.pi))
    centre = (*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.2, 0.6))
    return up, width, solid, np.array([*centre, *more])


@pytest.mark.parametrize("shape", CASES)
def test_solids_are_placed_where_they_stand_and_the_covariance_is_honest(shape):
    rng = np.random.default_rng(0)
    squares = []
    for _ in range(25):
        up, width, solid, state = random_case(rng, shape)
        points = outline(solid, state, rng)
        found = place(lines_of_sight(points), shape, width, PIXEL, up, 0.0)
        assert found.p_camera == pytest.approx(state[:3], abs=0.012 * state[2])
        miss = found.p_camera - state[:3]
        squares.append(miss @ np.linalg.solve(found.noise[:3, :3], miss))
        low = min(float((body @ up).min()) for body, _ in solid(state))
        if shape != "ball":
            assert found.foot == pytest.approx(low, abs=0.006)
    assert np.median(squares) < 6  # points err apart here, and the eye expects them to err alike


@pytest.mark.parametrize("shape", CASES)
def test_derivatives_are_those_of_the_distances(shape):
    rng = np.random.default_rng(1)
    for _ in range(10):
        _, _, solid, state = random_case(rng, shape)
        points = outline(solid, state, rng, noise_px=2.0)
        base = silhouette.compare(solid, state, points, PIXEL)
        for k in range(len(state)):
            step = np.zeros(len(state))
            step[k] = 1e-6
            change = (
                silhouette.compare(solid, state + step, points, PIXEL).off_px
                - silhouette.compare(solid, state - step, points, PIXEL).off_px
            ) / 2e-6
            # corners pass a point from one side to the next
            assert np.median(np.abs(change - base.slope[:, k])) < 1e-2 * np.abs(change).max()


@pytest.mark.parametrize("shape", CASES)
def test_a_hidden_part_is_refused(shape):
    rng = np.random.default_rng(2)
    refused = 0
    for _ in range(20):
        up, width, solid, state = random_case(rng, shape)
        points = outline(solid, state, rng)
        # a straight slanted edge hides a third of it
        angle = rng.uniform(0.4, 1.2) * rng.choice([-1, 1])
        across = points @ [math.cos(angle), math.sin(angle)]
        cut = across.min() + 0.35 * np.ptp(across)
        kept = points[across > cut]
        along = points @ [-math.sin(angle), math.cos(angle)]
        near = np.abs(across - cut) < 4 * PIXEL
        ends = along[near] if near.any() else along
        edge = np.linspace(ends.min(), ends.max(), 60)[:, None] * [
            -math.sin(angle),
            math.cos(angle),
        ] + cut * np.array([math.cos(angle), math.sin(angle)])
        found = place(lines_of_sight(np.concatenate([kept, edge])), shape, width, PIXEL, up, 0.0)
        refused += found is Refusal.PARTIAL
    assert refused >= 18


def test_what_is_thin_is_refused():
    points = np.column_stack([np.linspace(0, 0.1, 50), np.full(50, 0.02)])
    assert place(lines_of_sight(points), "ball", 0.03, PIXEL, UP, 0.1) is Refusal.THIN
