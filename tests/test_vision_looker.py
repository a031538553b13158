"""Picture after picture: what stands still is measured once, and what changes is measured anew."""

import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.vision import looker
from arm3dof.vision.camera import Camera, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange
from arm3dof.vision.locate import look
from arm3dof.vision.looker import Looker

CAMERA = Camera.pinhole(320, 240, 320.0, look_at([0.3, 0.0, 0.4], [0.3, 0.0, 0.0]))
TARGETS = (
    ColourTarget("green", HsvRange((45, 90, 30), (85, 255, 255)), 0.03, "ball"),
    ColourTarget("blue", HsvRange((100, 90, 30), (130, 255, 255)), 0.03, "ball"),
)
GREEN, BLUE = (30, 160, 40), (170, 70, 20)  # BGR


def picture(rng, green=(90.0, 110.0), blue=(210.0, 120.0), level=200.0, sigma=2.0):
    """Two discs with smooth edges and a sensor's noise, shape (240, 320, 3)."""
    v, u = np.mgrid[:240, :320].astype(float)
    clean = np.full((240, 320, 3), level)
    for middle, colour in ((green, GREEN), (blue, BLUE)):
        cover = np.clip(15.0 + 0.5 - np.hypot(u - middle[0], v - middle[1]), 0, 1)[..., None]
        clean = (1 - cover) * clean + cover * np.array(colour)
    noisy = clean + sigma * rng.standard_normal(clean.shape)
    return np.clip(noisy + 0.5, 0, 255).astype(np.uint8)


@pytest.fixture
def measured(monkeypatch):
    """The names of what is measured, as it is."""
    names, locate = [], looker.locate

    def counted(image, camera, blob, target):
        names.append(target.name)
        return locate(image, camera, blob, target)

    monkeypatch.setattr(looker, "locate", counted)
    return names


def places(view):
    return {it.target: it.p_base for it in view.located}


def test_it_sees_what_a_single_look_sees():
    image = picture(np.random.default_rng(0))
    once, first = look(image, CAMERA, TARGETS), Looker(CAMERA, TARGETS).look(image)
    assert len(first.located) == 2
    for name, place in places(once).items():
        np.testing.assert_array_equal(places(first)[name], place)


def test_what_stands_still_is_measured_once(measured):
    rng = np.random.default_rng(1)
    eye = Looker(CAMERA, TARGETS)
    views = [eye.look(picture(rng)) for _ in range(20)]
    assert sorted(measured) == ["blue", "green"]
    assert all(len(view.located) == 2 for view in views)


def test_only_what_moves_is_measured_anew(measured):
    rng = np.random.default_rng(2)
    eye = Looker(CAMERA, TARGETS)
    eye.look(picture(rng))
    for step in (0.5, 1.5, 40.0):
        measured.clear()
        image = picture(rng, green=(90.0 + step, 110.0))
        view = eye.look(image)
        assert measured == ["green"]
        np.testing.assert_array_equal(
            places(view)["green"], places(look(image, CAMERA, TARGETS))["green"]
        )


def test_a_slow_drift_is_not_missed():
    rng = np.random.default_rng(3)
    eye = Looker(CAMERA, TARGETS)
    for step in range(60):
        image = picture(rng, green=(90.0 + 0.1 * step, 110.0))
        apart = places(eye.look(image))["green"] - places(look(image, CAMERA, TARGETS))["green"]
        assert np.linalg.norm(apart[:2]) < 0.6e-3


def test_a_shadow_over_everything_lets_all_be_measured_anew(measured):
    rng = np.random.default_rng(4)
    eye = Looker(CAMERA, TARGETS)
    eye.look(picture(rng))
    measured.clear()
    eye.look(picture(rng, level=185.0))
    assert sorted(measured) == ["blue", "green"]


def test_what_is_gone_is_not_remembered(measured):
    rng = np.random.default_rng(5)
    eye = Looker(CAMERA, TARGETS)
    eye.look(picture(rng))
    gone = picture(rng, green=(-100.0, -100.0))
    assert set(places(eye.look(gone))) == {"blue"}
    measured.clear()
    assert set(places(eye.look(picture(rng)))) == {"blue", "green"}
    assert measured == ["green"]


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(InputError, match="calibrated for 320 x 240"):
        Looker(CAMERA, TARGETS).look(np.zeros((100, 100, 3), np.uint8))
