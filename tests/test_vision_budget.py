"""What errors of the camera do to a point, against pictures of a camera that errs."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from arm3dof.config.camera_file import load_camera
from arm3dof.errors import InputError
from arm3dof.runtime.campaign import trial_rng
from arm3dof.runtime.see_trial import SeeTrial
from arm3dof.runtime.table_scenes import random_scene
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.vision.budget import Cause, Table, judge
from arm3dof.vision.camera import Camera, Doubt, intrinsics
from arm3dof.vision.locate import look
from arm3dof.vision.placing import Refusal

DOUBT = Doubt(focal_px=6.0, centre_px=3.0, position_m=0.002, rotation_rad=0.006)


def scene(number, kinds=("ball", "cylinder", "cube")):
    rng = trial_rng(9, number)
    table = random_scene(rng, kinds, 1)
    camera = replace(table.camera, gamma=2.2)
    return table.placed[0], camera, SeeTrial().picture(table, rng), table.scene.table.height, rng


def wrong(camera, rng):
    """A camera whose numbers are off by what its doubt says."""
    f, c = camera.focal_px[0] + rng.normal(0, DOUBT.focal_px), camera.camera_matrix[:2, 2]
    u, v = c + rng.normal(0, DOUBT.centre_px, 2)
    turn = rng.normal(0, DOUBT.rotation_rad, 3)
    x, y, z = turn
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose = camera.transform_base_camera.copy()
    pose[:3, :3] = pose[:3, :3] @ (np.eye(3) + skew + skew @ skew / 2)
    pose[:3, 3] += rng.normal(0, DOUBT.position_m, 3)
    return Camera(640, 480, intrinsics(f, f, u, v), np.zeros(0), pose, 2.2, DOUBT)


@pytest.mark.slow
def test_the_stated_covariance_covers_a_camera_that_errs():
    squares, sigmas = ([], []), ([], [])
    for number in range(90):
        placed, camera, image, height, rng = scene(number)
        camera = wrong(camera, rng)
        for kind, table in enumerate((None, Table(height, 0.001))):
            for it in look(image, camera, [placed.target], table=table).located:
                miss = it.p_base - placed.centre
                squares[kind].append(miss @ np.linalg.solve(it.covariance_base, miss))
                sigmas[kind].append(it.sigma_m)
    for found in squares:
        assert len(found) >= 86
        assert np.mean(np.array(found) < 6.25) >= 0.8
        assert 1.2 < np.median(found) < 3.5  # 2.37 of a normal law
    assert np.median(sigmas[1]) < np.median(sigmas[0])


def test_a_table_makes_places_more_certain_and_refuses_what_does_not_stand_there():
    for number in range(6):
        placed, camera, image, height, _ = scene(number)
        free = look(image, camera, [placed.target]).located[0]
        stood = look(image, camera, [placed.target], table=Table(height, 0.0005)).located[0]
        assert stood.sigma_m <= free.sigma_m
        np.testing.assert_allclose(sum(stood.budget.values()), stood.covariance_base, atol=1e-12)
        if placed.target.shape != "cylinder" or Cause.TABLE in stood.budget:
            assert abs(stood.p_base[2] - placed.centre[2]) < 0.002
        view = look(image, camera, [placed.target], table=Table(height + 0.1))
        assert view.located == ()
        assert view.refused[0].reason is Refusal.AFLOAT


def test_the_verdict_names_what_would_help():
    eye = np.eye(3)
    budget = {
        Cause.EDGE: 0.015**2 * eye,
        Cause.LENS: 0.0147**2 * eye,
        Cause.WIDTH: 0.001**2 * eye,
        Cause.POSE: 0 * eye,
    }
    verdict = judge(budget, 0.008)
    assert not verdict.good
    assert verdict.sentence == (
        "target too uncertain: sigma 21 mm > 8.0 mm; "
        "move the camera nearer or calibrate the focal length"
    )
    assert list(verdict.by_cause) == [Cause.EDGE, Cause.LENS, Cause.WIDTH, Cause.POSE]
    assert verdict.sigma_m == pytest.approx(math.sqrt(sum(s**2 for s in verdict.by_cause.values())))
    assert judge(budget, 0.03).good
    assert judge(budget, 0.03).sentence == "target certain enough: sigma 21 mm of 30 mm"


def test_each_doubt_has_its_cause():
    placed, camera, image, _, _ = scene(3)
    plain = look(image, camera, [placed.target]).located[0]
    assert plain.judge(1.0).good
    cures = {
        Doubt(focal_px=60): Cause.LENS,
        Doubt(centre_px=60): Cause.LENS,
        Doubt(position_m=0.1): Cause.POSE,
        Doubt(rotation_rad=0.3): Cause.POSE,
    }
    for doubt, cause in cures.items():
        it = look(image, replace(camera, doubt=doubt), [placed.target]).located[0]
        assert cause.value in it.judge(0.001).sentence
        assert next(iter(it.judge(0.001).by_cause)) is cause
    unsure = replace(placed.target, width_sigma_m=0.01)
    it = look(image, camera, [unsure]).located[0]
    assert Cause.WIDTH.value in it.judge(0.001).sentence


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Doubt(focal_px=-1), "focal_px is -1"),
        (lambda: Doubt(position_m=math.nan), "position_m is nan"),
        (lambda: Table(math.inf), "height_m is inf"),
        (lambda: Table(0, 0), "sigma_m is 0"),
        (lambda: judge({Cause.EDGE: np.eye(3)}, 0), "limit_m is 0"),
    ],
)
def test_numbers_that_are_none_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_what_was_seen_crosses_to_another_process():
    camera, targets = load_camera("paper")
    picture = draw_demo(camera, np.random.default_rng(0))
    (seen,) = look(picture, camera, [targets["green"]]).located
    sent = pickle.loads(pickle.dumps(seen))
    assert (sent.target, sent.box_px, sent.depth_m) == (seen.target, seen.box_px, seen.depth_m)
    np.testing.assert_array_equal(sent.covariance_base, seen.covariance_base)
    assert list(sent.budget) == list(seen.budget)
    for cause, covariance in seen.budget.items():
        np.testing.assert_array_equal(sent.budget[cause], covariance)
    assert not sent.p_base.flags.writeable
