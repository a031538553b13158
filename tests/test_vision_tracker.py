"""Tracks of simulated objects whose motion is known."""

import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.vision.budget import Cause
from arm3dof.vision.locate import Located, View
from arm3dof.vision.tracker import Tracker, TrackerSettings

RATE = 20.0


def seen_at(place, noise, shared, target="red"):
    parts = {Cause.NOISE: noise, Cause.EDGE: shared}
    box, outline = (0, 0, 9, 9), (0.0, 0.0, 9.0, 9.0)
    return Located(target, box, outline, 0.3, 0.002, place, place, noise + shared, parts)


def spread(rng, least, most):
    """A covariance of the shape that an eye's has: long in one direction."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return axes @ np.diag(np.square([most, least, least])) @ axes.T


def walk(rng, steps, acceleration):
    """An object whose acceleration is white noise."""
    place, speed = rng.uniform(-0.2, 0.2, 3), rng.normal(0, 0.1, 3)
    dt = 1 / RATE
    for _ in range(steps):
        yield place.copy(), speed.copy()
        kick = rng.normal(0, acceleration * np.sqrt(dt), 3)
        place += speed * dt + kick * dt / 2
        speed += kick


def test_the_stated_interval_holds_and_many_pictures_do_not_mend_a_camera():
    rng = np.random.default_rng(0)
    squares, sigmas = [], []
    for _ in range(40):
        noise, shared = spread(rng, 0.001, 0.003), spread(rng, 0.0005, 0.002)
        bias = rng.multivariate_normal(np.zeros(3), shared)
        tracker = Tracker(TrackerSettings(acceleration_sigma=0.3))
        for k, (place, _) in enumerate(walk(rng, 60, 0.3)):
            seen = place + bias + rng.multivariate_normal(np.zeros(3), noise)
            tracks = tracker.update([seen_at(seen, noise, shared)], k / RATE)
        (track,) = tracks
        miss = track.p_base - place
        squares.append(miss @ np.linalg.solve(track.covariance_base, miss))
        sigmas.append(track.sigma_m)
        assert track.sigma_m >= 0.999 * np.sqrt(np.linalg.eigvalsh(shared)[-1])
    assert 0.8 <= np.mean(np.array(squares) < 6.25) <= 0.97
    assert 2 < np.mean(squares) < 4.2  # 3 of a normal law
    assert np.mean(sigmas) < 0.0035  # better than one picture


def test_speed_is_learned_and_places_are_foretold():
    tracker = Tracker()
    speed, small = np.array([0.05, -0.02, 0.0]), 1e-8 * np.eye(3)
    for k in range(40):
        tracker.update([seen_at(speed * k / RATE, small, small)], k / RATE)
    (track,) = tracker.at(39 / RATE + 0.5)
    np.testing.assert_allclose(track.v_base, speed, atol=0.005)
    np.testing.assert_allclose(track.p_base, speed * (39 / RATE + 0.5), atol=0.005)
    assert track.age_s == pytest.approx(0.5)
    assert track.sigma_m > tracker.at(39 / RATE)[0].sigma_m


def test_objects_keep_their_numbers_when_they_pass_each_other():
    rng = np.random.default_rng(1)
    tracker, noise = Tracker(), 1e-6 * np.eye(3)
    starts = [np.array([-0.1, 0.0, 0.0]), np.array([0.1, 0.01, 0.0]), np.array([0.0, 0.1, 0.0])]
    speeds = [np.array([0.1, 0, 0]), np.array([-0.1, 0, 0]), np.zeros(3)]
    names = ["red", "red", "blue"]
    for k in range(40):
        found = [
            seen_at(start + speed * k / RATE + rng.normal(0, 1e-3, 3), noise, noise, name)
            for start, speed, name in zip(starts, speeds, names, strict=True)
        ]
        order = rng.permutation(3)
        tracks = tracker.update(View(tuple(found[k] for k in order), ()), k / RATE)
    assert len(tracks) == 3
    by_end = {track.number: track for track in tracks}
    for start, speed, name in zip(starts, speeds, names, strict=True):
        end = start + speed * 39 / RATE
        mine = min(by_end.values(), key=lambda it: np.linalg.norm(it.p_base - end))
        assert mine.target == name
        assert mine.hits == 40


def test_what_is_not_seen_grows_uncertain_and_is_lost():
    tracker = Tracker(TrackerSettings(patience_s=0.5))
    small = 1e-6 * np.eye(3)
    assert tracker.update([seen_at(np.zeros(3), small, small)], 0.0) == ()  # once is no proof
    (track,) = tracker.update([seen_at(np.zeros(3), small, small)], 0.1)
    assert (track.hits, track.age_s) == (2, 0)
    (gone,) = tracker.update([], 0.5)
    assert gone.age_s == pytest.approx(0.4)
    assert gone.sigma_m > track.sigma_m
    assert tracker.update([], 0.7) == ()
    tracker.update([seen_at(np.zeros(3), small, small)], 0.8)
    (new,) = tracker.update([seen_at(np.zeros(3), small, small)], 0.9)
    assert new.number == 1


def test_what_jumps_is_another_object():
    tracker = Tracker(TrackerSettings(confirm=1))
    small = 1e-6 * np.eye(3)
    for k in range(5):
        tracker.update([seen_at(np.zeros(3), small, small)], k / RATE)
    tracks = tracker.update([seen_at(np.array([0.3, 0, 0]), small, small)], 5 / RATE)
    assert [it.number for it in tracks] == [0, 1]


def test_time_runs_forwards():
    tracker = Tracker()
    tracker.update([], 1.0)
    for t in (1.0, 0.5, np.nan):
        with pytest.raises(InputError, match="give the pictures in the order of time"):
            tracker.update([], t)
    with pytest.raises(InputError, match="from the last picture's on"):
        tracker.at(0.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"acceleration_sigma": 0}, "acceleration_sigma is 0"),
        ({"patience_s": np.inf}, "patience_s is inf"),
        ({"confirm": 0}, "confirm is 0"),
    ],
)
def test_settings_out_of_range_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        TrackerSettings(**change)
