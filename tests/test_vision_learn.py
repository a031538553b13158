"""Colours learned from one click, in drawn scenes and photographs."""

import numpy as np
import pytest
from photos import overlap, photo

from arm3dof.errors import InputError
from arm3dof.runtime.campaign import trial_rng
from arm3dof.runtime.see_trial import SeeTrial
from arm3dof.vision.colour import HsvRange, find_blobs
from arm3dof.vision.learn import learn_colour


def test_one_click_is_enough_to_find_the_thing_again():
    overlaps = []
    for number in range(8):
        rng = trial_rng(4, number)
        table = SeeTrial().scene(rng)
        picture = SeeTrial().picture(table, rng)
        for placed in table.placed:
            true = find_blobs(picture, placed.target.hsv)[0]
            rows, columns = np.nonzero(_filled(true, picture.shape))
            pick = rng.integers(len(rows))
            learned = learn_colour(picture, (int(columns[pick]), int(rows[pick])))
            again = find_blobs(picture, learned.hsv)
            overlaps.append(max(overlap(it.box_px, true.box_px) for it in again))
            assert overlap(learned.blob.box_px, true.box_px) == overlaps[-1]
            assert len(again) == learned.others + 1
    assert np.mean(np.array(overlaps) > 0.8) > 0.95


def _filled(blob, shape):
    import cv2

    mask = np.zeros(shape[:2], np.uint8)
    cv2.drawContours(mask, [blob.contour.reshape(-1, 1, 2)], -1, 1, cv2.FILLED)
    return cv2.erode(mask, np.ones((7, 7), np.uint8))


@pytest.mark.parametrize("place", [(300, 200), (250, 180, 60, 60)])
def test_the_dahlia_from_a_click_or_a_box(place):
    learned = learn_colour(photo("sklearn", "datasets", "images", "flower.jpg"), place)
    assert overlap(learned.blob.box_px, (168, 84, 278, 275)) > 0.9


def test_on_wood_of_nearly_its_colour_a_part_of_the_saucer_is_learned_and_no_wood():
    learned = learn_colour(photo("skimage", "data", "coffee.png"), (430, 300))
    u, v, width, height = learned.blob.box_px
    assert min(u - 77, v - 66, 480 - u - width, 388 - v - height) > -5
    assert overlap(learned.blob.box_px, (77, 66, 403, 322)) > 0.45


def test_red_wraps_around():
    picture = np.full((120, 160, 3), 128, np.uint8)
    picture[30:90, 40:100] = (20, 20, 210)
    picture[30:60, 40:100] = (40, 20, 210)  # hues on both sides of 0
    learned = learn_colour(picture, (70, 60))
    assert learned.hsv.wraps
    assert overlap(learned.blob.box_px, (40, 30, 60, 60)) > 0.9
    assert learned.others == 0


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((5, 5), "grey or dark .saturation 0"),
        ((-1, 5), "outside the picture of 160 x 120"),
        ((160, 5), "outside the picture"),
        ((5, 5, 0, 3), "is empty"),
        ((5,), "give a point u, v or a box"),
        ((5.5, 5), "give a point u, v or a box"),
        ((70, 60), "smaller than 100 pixels"),
    ],
)
def test_what_cannot_be_learned_says_why(place, message):
    picture = np.full((120, 160, 3), 128, np.uint8)
    picture[57:63, 67:73] = (20, 200, 20)
    with pytest.raises(InputError, match=message):
        learn_colour(picture, place)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (3, 3)])
def test_tiny_pictures_of_one_colour(shape):
    with pytest.raises(InputError, match="smaller than"):
        learn_colour(np.full((*shape, 3), (0, 200, 0), np.uint8), (0, 0))


def test_a_whole_picture_of_one_colour_is_one_thing():
    learned = learn_colour(np.full((60, 80, 3), (0, 200, 0), np.uint8), (40, 30))
    assert learned.blob.touches_border
    assert isinstance(learned.hsv, HsvRange)
