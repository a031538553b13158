"""The eye on real photographs; the boxes were drawn by hand."""

import numpy as np
import pytest
from photos import overlap, photo

from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, HsvRange, find_blobs
from arm3dof.vision.locate import look
from arm3dof.vision.placing import Refusal


@pytest.fixture(scope="module")
def coffee():
    return photo("skimage", "data", "coffee.png")


@pytest.fixture(scope="module")
def flower():
    return photo("sklearn", "datasets", "images", "flower.jpg")


@pytest.fixture(scope="module")
def astronaut():
    return photo("skimage", "data", "astronaut.png")


SAUCER, DAHLIA = (77, 66, 403, 322), (168, 84, 278, 275)  # u, v, width, height [px]
SAUCER_RED, DAHLIA_ORANGE = (
    HsvRange((0, 190, 60), (8, 255, 255)),
    HsvRange((2, 90, 120), (20, 255, 255)),
)


@pytest.mark.parametrize(
    "colour",
    [
        SAUCER_RED,
        HsvRange((0, 200, 100), (8, 255, 255)),
        HsvRange((0, 220, 60), (7, 255, 255)),
        HsvRange((170, 150, 60), (8, 255, 255)),
    ],
)
def test_the_red_saucer_under_a_cup_on_red_wood(coffee, colour):
    height, width = coffee.shape[:2]
    target = ColourTarget("saucer", colour, 0.14)
    view = look(coffee, Camera.pinhole(width, height, 640), [target])
    it = view.located[0]
    assert overlap(it.box_px, SAUCER) >= 0.9
    assert it.depth_m == pytest.approx(640 * 0.14 / SAUCER[2], rel=0.05)
    assert it.depth_sigma_m < 0.01


def test_the_dahlia_and_the_other_that_the_border_cuts(flower):
    height, width = flower.shape[:2]
    target = ColourTarget("dahlia", DAHLIA_ORANGE, 0.10, "ball")
    view = look(flower, Camera.pinhole(width, height, 700), [target])
    it = view.located[0]
    assert overlap(it.box_px, DAHLIA) >= 0.95
    assert it.depth_m == pytest.approx(700 * 0.10 / DAHLIA[2], rel=0.05)
    assert view.refused[0].reason is Refusal.BORDER
    assert overlap(view.refused[0].box_px, (288, 375, 180, 52)) > 0.8


def test_the_orange_suit_is_seen_and_not_measured(astronaut):
    colour = HsvRange((3, 150, 100), (12, 255, 255))
    suit = find_blobs(astronaut, colour)[0]  # its right half, up to the white strap
    assert overlap(suit.box_px, (22, 206, 228, 306)) >= 0.9
    target = ColourTarget("suit", colour, 0.5)
    view = look(astronaut, Camera.pinhole(512, 512, 600), [target])
    assert view.refused[0].reason is Refusal.BORDER
    assert all(it.box_px != suit.box_px for it in view.located)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_same_object_in_smaller_and_larger_pictures(flower, scale):
    import cv2

    image = cv2.resize(flower, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    box = find_blobs(image, DAHLIA_ORANGE)[0].box_px
    assert overlap(np.array(box) / scale, DAHLIA) >= 0.95


MOTORCYCLE = HsvRange((170, 150, 60), (5, 255, 255))
RETINA = HsvRange((0, 60, 90), (20, 255, 255))


@pytest.mark.parametrize(
    ("name", "colour", "box", "least"),
    [
        # the tank and side of a red motorcycle in a garage
        ("motorcycle_left.png", MOTORCYCLE, (170, 173, 315, 110), 0.75),
        # the back of an eye, which fills a picture of 1411 x 1411 from edge to edge
        ("retina.jpg", RETINA, (8, 2, 1396, 1400), 0.95),
    ],
)
def test_more_photographs(name, colour, box, least):
    image = photo("skimage", "data", name)
    assert overlap(find_blobs(image, colour)[0].box_px, box) >= least
