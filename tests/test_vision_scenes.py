"""The eye against drawn scenes whose truth is known: nothing but the picture is shared."""

import numpy as np
import pytest
from scenes import COLOURS, random_trial

from arm3dof.vision.colour import ColourTarget
from arm3dof.vision.locate import look


def measure(seed):
    """Return the relative error of depth, in sigmas too, and the distance by which it is off."""
    trial = random_trial(np.random.default_rng([seed, 2026]))
    view = look(trial.image, trial.camera, [trial.target])
    assert len(view.located) == 1, f"scene {seed}: {view}"
    assert view.refused == (), f"scene {seed}: {view}"
    it = view.located[0]
    depth = trial.camera.to_camera(trial.centre)[2]
    assert 0.15 <= depth <= 0.6
    error = it.depth_m - depth
    return error / depth, error / it.depth_sigma_m, np.linalg.norm(it.p_base - trial.centre)


def judge(seeds):
    relative, sigmas, distance = np.array([measure(seed) for seed in seeds]).T
    assert np.abs(relative).max() < 0.03
    assert np.median(distance) < 0.003
    assert np.percentile(distance, 95) < 0.008
    # nine in ten lie within what a normal law with the stated sigma gives nine in ten
    assert np.mean(np.abs(sigmas) < 1.645) > 0.85


def test_depth_is_recovered_in_drawn_scenes():
    judge(range(60))


@pytest.mark.slow
def test_depth_is_recovered_in_five_hundred_drawn_scenes():
    judge(range(60, 560))


def test_colours_that_are_not_there_are_not_seen():
    for seed in range(25):
        trial = random_trial(np.random.default_rng([seed, 7]))
        trial.image[:] = trial.image[:, :, [1, 1, 1]]  # the same scene without any colour
        targets = [ColourTarget(name, COLOURS[name][1], 0.03) for name in COLOURS]
        view = look(trial.image, trial.camera, targets)
        assert view.located == view.refused == ()
