import colorsys

import cv2
import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.vision.colour import (
    BlobSettings,
    ColourTarget,
    HsvRange,
    blurred_hsv,
    check_image,
    find_blobs,
)

GREEN = HsvRange((50, 100, 50), (70, 255, 255))
BGR_GREEN, BGR_RED, BGR_GREY = (30, 190, 30), (40, 30, 200), (150, 150, 150)


def blank(height=120, width=160, colour=BGR_GREY):
    return np.full((height, width, 3), colour, np.uint8)


def inside(hsv, low, high):
    """Whether one HSV pixel is in a range, in words rather than with OpenCV."""
    hue = low[0] <= hsv[0] <= high[0] if low[0] <= high[0] else not high[0] < hsv[0] < low[0]
    return hue and low[1] <= hsv[1] <= high[1] and low[2] <= hsv[2] <= high[2]


def test_a_mask_holds_the_pixels_in_range_also_when_the_hue_wraps():
    rng = np.random.default_rng(0)
    wraps = 0
    for _ in range(60):
        hues = rng.integers(0, 180, 2)
        low, high = np.sort(rng.integers(0, 256, (2, 2)), axis=0)
        bounds = HsvRange((hues[0], *low), (hues[1], *high))
        hsv = rng.integers(0, [180, 256, 256], (12, 15, 3)).astype(np.uint8)
        hsv[0, 0], hsv[0, 1] = bounds.low, bounds.high
        expected = [[inside(pixel, bounds.low, bounds.high) for pixel in row] for row in hsv]
        assert ((bounds.mask(hsv) == 255) == np.array(expected)).all()
        assert set(np.unique(bounds.mask(hsv))) <= {0, 255}
        wraps += bounds.wraps
    assert 10 < wraps < 50


def test_red_is_found_on_both_sides_of_hue_zero():
    red = HsvRange((170, 100, 50), (10, 255, 255))
    for hue in np.linspace(-18, 18, 13):
        rgb = 255 * np.array(colorsys.hsv_to_rgb((hue / 360) % 1, 0.9, 0.8))
        image = blank()
        image[40:80, 50:90] = rgb[::-1].round()
        (blob,) = find_blobs(image, red)
        assert np.abs(np.subtract(blob.box_px, (50, 40, 40, 40))).max() <= 1
        assert find_blobs(image, GREEN) == ()


def test_boxes_of_rectangles_are_right_to_a_pixel_whatever_the_dilation():
    rng = np.random.default_rng(1)
    for trial in range(60):
        image = blank()
        u, v = rng.integers(5, 60, 2)
        w, h = rng.integers(12, 50, 2)
        image[v : v + h, u : u + w] = BGR_GREEN
        settings = BlobSettings(dilate_px=trial % 5)
        (blob,) = find_blobs(image, GREEN, settings)
        assert np.abs(np.subtract(blob.box_px, (u, v, w, h))).max() <= 1
        assert blob.area_px == pytest.approx(w * h, rel=0.35)
        assert not blob.touches_border
        assert not blob.contour.flags.writeable


def test_the_largest_comes_first_and_specks_are_noise():
    image = blank()
    cv2.circle(image, (30, 30), 8, BGR_GREEN, -1)
    cv2.circle(image, (100, 60), 20, BGR_GREEN, -1)
    cv2.circle(image, (30, 90), 12, BGR_GREEN, -1)
    cv2.circle(image, (70, 110), 2, BGR_GREEN, -1)
    blobs = find_blobs(image, GREEN)
    assert [blob.box_px[0] // 10 for blob in blobs] == [8, 1, 2]
    assert sorted((blob.area_px for blob in blobs), reverse=True) == [b.area_px for b in blobs]
    assert len(find_blobs(image, GREEN, BlobSettings(min_area_px=500))) == 1
    assert len(find_blobs(image, GREEN, BlobSettings(min_area_px=0, blur_px=1))) == 4


def test_dilation_joins_what_a_thin_line_parts():
    image = blank()
    image[40:80, 50:90] = BGR_GREEN
    image[40:80, 69:71] = BGR_GREY
    assert len(find_blobs(image, GREEN, BlobSettings(dilate_px=0, blur_px=1))) == 2
    (blob,) = find_blobs(image, GREEN)
    assert np.abs(np.subtract(blob.box_px, (50, 40, 40, 40))).max() <= 1


@pytest.mark.parametrize(
    ("rows", "columns", "box"),
    [
        ((0, 40), (60, 100), (60, 0, 40, 40)),
        ((80, 120), (60, 100), (60, 80, 40, 40)),
        ((40, 80), (0, 40), (0, 40, 40, 40)),
        ((40, 80), (120, 160), (120, 40, 40, 40)),
        ((0, 120), (0, 160), (0, 0, 160, 120)),
    ],
)
@pytest.mark.parametrize("dilate", [0, 2])
def test_the_border_is_told(rows, columns, box, dilate):
    image = blank()
    image[slice(*rows), slice(*columns)] = BGR_GREEN
    (blob,) = find_blobs(image, GREEN, BlobSettings(dilate_px=dilate))
    assert blob.touches_border
    assert np.abs(np.subtract(blob.box_px, box)).max() <= 1


def test_a_streak_to_the_border_does_not_make_a_patch_touch_it():
    image = blank(240, 320)
    cv2.circle(image, (150, 120), 50, BGR_GREEN, -1)
    cv2.line(image, (150, 120), (319, 30), BGR_GREEN, 3)
    (blob,) = find_blobs(image, GREEN)
    assert not blob.touches_border
    assert np.abs(np.subtract(blob.box_px, (100, 70, 101, 101))).max() <= 8


def test_a_thing_that_is_all_thin_keeps_its_shape():
    image = blank(240, 320)
    cv2.line(image, (60, 60), (260, 180), BGR_GREEN, 4)
    (blob,) = find_blobs(image, GREEN)
    assert np.abs(np.subtract(blob.box_px, (58, 58, 205, 125))).max() <= 3


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 2), (7, 5)])
@pytest.mark.parametrize("colour", [(0, 0, 0), (255, 255, 255), BGR_GREEN])
def test_tiny_and_plain_pictures_hold_nothing_or_one_thing(shape, colour):
    image = np.full((*shape, 3), colour, np.uint8)
    assert find_blobs(image, GREEN) == ()
    everything = find_blobs(image, GREEN, BlobSettings(min_area_px=0))
    assert all(blob.touches_border for blob in everything)


def test_noise_of_every_kind_never_breaks_it():
    rng = np.random.default_rng(2)
    for trial in range(80):
        shape = (*rng.integers(1, 60, 2), 3)
        image = rng.integers(0, 256, shape).astype(np.uint8)
        bounds = HsvRange((0, 0, 0), (179, 255, 255)) if trial % 4 == 0 else GREEN
        settings = BlobSettings(
            blur_px=int(rng.choice([1, 3, 5])),
            dilate_px=int(rng.integers(0, 4)),
            min_area_px=float(rng.choice([0, 1, 20])),
        )
        for blob in find_blobs(image, bounds, settings):
            u, v, w, h = blob.box_px
            assert w > 0
            assert h > 0
            assert 0 <= u <= u + w <= shape[1]
            assert 0 <= v <= v + h <= shape[0]


def test_hsv_is_opencv_s_own():
    image = blank(2, 2, BGR_GREEN)
    assert blurred_hsv(image, 1)[0, 0, 0] == 60
    assert blurred_hsv(image)[0, 0].tolist() == blurred_hsv(image, 1)[0, 0].tolist()


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        ((180, 0, 0), (10, 255, 255), "hue 180; give a whole number from 0 to 179 .OpenCV"),
        ((0, -1, 0), (10, 255, 255), "saturation -1"),
        ((0, 0, 0), (10, 255, 256), "value 256"),
        ((0, 0.5, 0), (10, 255, 255), "saturation 0.5"),
        ((0, 0), (10, 255, 255), "give hue, saturation and value"),
        ((0, 200, 0), (10, 100, 255), "saturation 200 above hsv_high's 100"),
        ((0, 0, 9), (10, 100, 8), "only hue wraps"),
    ],
)
def test_bounds_that_are_none_are_refused(low, high, message):
    with pytest.raises(InputError, match=message):
        HsvRange(low, high)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": ""}, "no name"),
        ({"width_m": 0.0}, "metres above 0"),
        ({"width_m": float("nan")}, "metres above 0"),
        ({"shape": "cone"}, "one of: flat, ball, cylinder, cube, bottle"),
        ({"width_sigma_m": -1.0}, "0 or more"),
    ],
)
def test_targets_that_are_none_are_refused(change, message):
    good = {"name": "green", "hsv": GREEN, "width_m": 0.03}
    ColourTarget(**good)
    with pytest.raises(InputError, match=message):
        ColourTarget(**(good | change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"blur_px": 4}, "odd"),
        ({"blur_px": 0}, "odd"),
        ({"dilate_px": -1}, "dilate_px is -1"),
        ({"min_area_px": float("nan")}, "min_area_px is nan"),
    ],
)
def test_settings_out_of_range_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        BlobSettings(**change)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4), np.uint8),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4, 4, 3), np.uint16),
        np.zeros((4, 4, 3)),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((4, 0, 3), np.uint8),
        None,
        [[1, 2, 3]],
    ],
)
def test_what_is_no_bgr_picture_is_refused(image):
    with pytest.raises(InputError, match="give BGR bytes"):
        find_blobs(image, GREEN)


def test_views_into_other_pictures_are_pictures():
    image = blank()
    image[40:80, 50:90] = BGR_RED
    red = HsvRange((170, 100, 50), (10, 255, 255))
    assert check_image(image[:, ::-1]).flags.c_contiguous
    (blob,) = find_blobs(image[:, ::-1], red)
    assert np.abs(np.subtract(blob.box_px, (70, 40, 40, 40))).max() <= 1
