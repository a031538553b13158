"""The eye against drawn scenes whose truth is known: nothing but the picture is shared."""

import numpy as np
import pytest

from arm3dof.runtime.campaign import run_campaign
from arm3dof.runtime.see_trial import SeeTrial, goals, see_report
from arm3dof.runtime.table_scenes import COLOURS, random_scene
from arm3dof.vision.colour import ColourTarget
from arm3dof.vision.locate import look


def test_objects_are_found_where_they_are():
    report = see_report(run_campaign(SeeTrial(), 30, 2026))
    assert report["recall"] == 1
    assert report["false_objects"] == 0
    assert report["median_error_m"] < 0.003
    assert report["p95_error_m"] < 0.008
    assert report["coverage_90"] > 0.8


@pytest.mark.slow
def test_the_goals_are_reached_over_three_hundred_tables():
    report = see_report(run_campaign(SeeTrial(), 300, 7))
    assert all(goals(report).values()), report


def test_colours_that_are_not_there_are_not_seen():
    for seed in range(12):
        table = random_scene(np.random.default_rng([seed, 7]))
        image = SeeTrial().picture(table, np.random.default_rng(seed))
        image[:] = image[:, :, [1, 1, 1]]  # the same scene without any colour
        targets = [ColourTarget(name, COLOURS[name][1], 0.03) for name in COLOURS]
        view = look(image, table.camera, targets)
        assert view.located == view.refused == ()
