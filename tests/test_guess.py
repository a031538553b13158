"""Guesses about pictures that nobody has calibrated."""

import cv2
import numpy as np
import pytest
from photos import COFFEE, FLOWER

from arm3dof.errors import InputError
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, find_blobs
from arm3dof.vision.guess import DISTANCE, FOCAL_SHARE, guess_camera, guess_colour, guess_width
from arm3dof.vision.locate import look


def overlap(first, second):
    """Intersection over union of two boxes (u, v, width, height)."""
    low = np.maximum(first[:2], second[:2])
    high = np.minimum(np.add(first[:2], first[2:]), np.add(second[:2], second[2:]))
    common = np.prod(np.clip(high - low, 0, None))
    return common / (np.prod(first[2:]) + np.prod(second[2:]) - common)


@pytest.mark.parametrize(
    ("path", "box"),
    [(COFFEE, (77, 69, 402, 320)), (FLOWER, (168, 84, 279, 277))],
    ids=["saucer", "dahlia"],
)
def test_the_conspicuous_object_of_a_photograph(path, box):
    picture = cv2.imread(str(path))
    colour = guess_colour(picture)
    largest = find_blobs(picture, colour)[0]
    assert overlap(largest.box_px, box) > 0.9


@pytest.mark.parametrize("hue", range(0, 180, 15))
def test_a_disc_of_any_colour_on_grey(hue):
    hsv = np.zeros((240, 320, 3), np.uint8)
    hsv[:] = (0, 0, 150)
    cv2.circle(hsv, (150, 110), 40, (hue, 220, 200), cv2.FILLED)
    picture = cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR)
    colour = guess_colour(picture)
    assert overlap(find_blobs(picture, colour)[0].box_px, (110, 70, 81, 81)) > 0.9


def test_what_reaches_the_border_is_background():
    picture = np.full((200, 300, 3), (40, 40, 200), np.uint8)  # red all over
    picture[60:120, 100:160] = (200, 60, 40)  # a blue square
    colour = guess_colour(picture)
    assert overlap(find_blobs(picture, colour)[0].box_px, (100, 60, 60, 60)) > 0.8


@pytest.mark.parametrize("value", [0, 128, 255])
def test_a_picture_without_colour_has_no_object(value):
    assert guess_colour(np.full((120, 160, 3), value, np.uint8)) is None


def test_a_large_picture_is_searched_small():
    picture = np.full((3000, 4000, 3), 128, np.uint8)
    cv2.circle(picture, (2000, 1500), 600, (30, 180, 40), cv2.FILLED)
    assert guess_colour(picture) is not None


def test_the_guessed_camera_has_the_pictures_size():
    pose = np.eye(4)
    camera = guess_camera(np.zeros((400, 600, 3), np.uint8), pose)
    assert (camera.width, camera.height) == (600, 400)
    assert camera.focal_px == (FOCAL_SHARE * 600,) * 2
    with pytest.raises(InputError, match="the picture has"):
        guess_camera(np.zeros((400, 600), np.uint8), pose)


def test_an_object_of_guessed_width_stands_at_the_distance():
    picture = np.full((400, 600, 3), 128, np.uint8)
    picture[150:250, 250:370] = (30, 180, 40)
    camera = Camera.pinhole(600, 400, 660.0)
    colour = guess_colour(picture)
    width = guess_width(picture, camera, colour)
    assert width == pytest.approx(120 / 660 * DISTANCE, rel=0.02)
    located = look(picture, camera, [ColourTarget("it", colour, width)]).located
    assert located[0].depth_m == pytest.approx(DISTANCE, rel=0.03)


def test_the_width_of_what_is_not_seen_whole():
    picture = np.full((100, 100, 3), (30, 180, 40), np.uint8)
    camera = Camera.pinhole(100, 100, 110.0)
    green = guess_colour(cv2.copyMakeBorder(picture, 40, 40, 40, 40, cv2.BORDER_CONSTANT))
    assert guess_width(picture, camera, green) is None
