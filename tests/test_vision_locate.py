import math

import cv2
import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.sim.scene import Scene, draw
from arm3dof.sim.shapes import Ball, Cylinder
from arm3dof.sim.table import Table
from arm3dof.vision.camera import Camera, intrinsics, look_at
from arm3dof.vision.colour import BlobSettings, ColourTarget, HsvRange, find_blobs
from arm3dof.vision.focal import (
    FocalReference,
    depth_from_width,
    focal_from_picture,
    focal_length,
)
from arm3dof.vision.locate import Located, look, see
from arm3dof.vision.outline import extent, trace
from arm3dof.vision.placing import Refusal

GREEN = HsvRange((45, 90, 30), (85, 255, 255))
RED = HsvRange((173, 120, 40), (6, 255, 255))
PAINT = {"green": (0.1, 0.62, 0.24), "red": (0.8, 0.1, 0.1)}
F = 600.0


def card(width, height, middle, size=(480, 640), light=1.0, noise=0.0, rng=None):
    """Draw a green card whose edges fall anywhere between pixels; `light` is the gamma."""
    rows, columns = np.arange(size[0])[:, None], np.arange(size[1])[None, :]

    def cover(pixels, centre, length):
        low = np.maximum(pixels - 0.5, centre - length / 2)
        return np.clip(np.minimum(pixels + 0.5, centre + length / 2) - low, 0, 1)

    share = (cover(columns, middle[0], width) * cover(rows, middle[1], height))[..., None]
    front, back = np.array([35.0, 140, 30]), np.array([150.0, 175, 190])
    image = (share * front**light + (1 - share) * back**light) ** (1 / light)
    if rng is not None:
        image += rng.normal(0, noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


# ---- (1) and (2) ------------------------------------------------------------------------------


def test_depth_undoes_focal_length():
    rng = np.random.default_rng(0)
    for _ in range(200):
        pixels, distance, width = rng.uniform([5, 0.1, 0.01], [300, 2, 0.2])
        focal = focal_length(pixels, distance, width)
        assert focal == pytest.approx(pixels * distance / width)  # F = P D / W
        assert depth_from_width(pixels, focal, width) == pytest.approx(distance)
        assert depth_from_width(pixels / 2, focal, width) == pytest.approx(2 * distance)


def test_what_is_round_looks_wider_than_it_is():
    # the ray that touches a ball at distance D leaves the axis at asin(R / D)
    radius, distance = 0.02, 0.15
    pixels = 2 * F * math.tan(math.asin(radius / distance))
    for shape in ("ball", "cylinder"):
        assert focal_length(pixels, distance, 2 * radius, shape) == pytest.approx(F)
    assert focal_length(pixels, distance, 2 * radius) > 1.005 * F


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: focal_length(0, 1, 1), "width_px is 0"),
        (lambda: focal_length(1, -1, 1), "distance_m is -1"),
        (lambda: focal_length(1, 1, math.nan), "width_m is nan"),
        (lambda: focal_length(1, 0.01, 0.03, "ball"), "more than half its width"),
        (lambda: depth_from_width(1, math.inf, 1), "focal_px is inf"),
        (lambda: depth_from_width(-1, 1, 1), "width_px is -1"),
    ],
)
def test_lengths_that_are_none_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


# ---- outlines -----------------------------------------------------------------------------------


@pytest.mark.parametrize("light", [1.0, 2.2])
def test_widths_of_straight_sides_are_right_to_a_fraction_of_a_pixel(light):
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(60):
        width, height = rng.uniform(14, 90, 2)
        middle = rng.uniform([70, 70], [130, 130])
        image = card(width, height, middle, (200, 200), light, rng.uniform(0, 5), rng)
        points = trace(image, find_blobs(image, GREEN)[0])
        across, down = extent(points[:, 0], points[:, 1], 1), extent(points[:, 1], points[:, 0], 1)
        errors += [across.size - width, down.size - height]
        assert across.middle == pytest.approx(middle[0], abs=0.25)
        assert down.middle == pytest.approx(middle[1], abs=0.25)
    assert np.abs(errors).max() < 0.6
    assert abs(np.mean(errors)) < 0.3  # the two gammas err to opposite sides


def test_widths_of_discs_are_right_to_a_fraction_of_a_pixel():
    rng = np.random.default_rng(2)
    v, u = np.mgrid[0:1600, 0:1600] / 8 - 0.4375
    for _ in range(20):
        radius = rng.uniform(7, 45)
        middle = rng.uniform([90, 90], [110, 110])
        share = np.hypot(u - middle[0], v - middle[1]) < radius
        share = share.reshape(200, 8, 200, 8).mean((1, 3))[..., None]
        light = share * np.array([35.0, 140, 30]) ** 1.5 + (1 - share) * 170.0**1.5
        image = light ** (1 / 1.5) + rng.normal(0, 3, light.shape)
        image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        points = trace(image, find_blobs(image, GREEN)[0])
        across = extent(points[:, 0], points[:, 1], 1.0)
        assert across.size == pytest.approx(2 * radius, abs=0.4)
        assert across.middle == pytest.approx(middle[0], abs=0.2)
        assert 0 < across.sigma < 0.3


def test_a_shadow_beside_a_thing_is_not_a_part_of_it():
    plain = card(40, 40, (100, 100), (200, 200))
    shaded = plain.copy()
    shaded[105:125, 121:150] = shaded[105:125, 121:150] // 3
    widths = []
    for image in (plain, shaded):
        points = trace(image, find_blobs(image, GREEN)[0])
        widths.append(extent(points[:, 0], points[:, 1], 1.0).size)
    assert widths[1] == pytest.approx(widths[0], abs=0.5)


def test_a_thread_has_no_outline_and_is_refused():
    image = card(2.2, 150, (100, 100), (200, 200))
    (blob,) = find_blobs(image, HsvRange((40, 60, 30), (90, 255, 255)))
    assert trace(image, blob) is None
    target = ColourTarget("thread", HsvRange((40, 60, 30), (90, 255, 255)), 0.01)
    view = look(image, Camera.pinhole(200, 200, F), [target])
    assert [it.reason for it in view.refused] == [Refusal.THIN]


def test_an_outline_of_few_points_still_has_an_extent():
    few = extent(np.array([0.0, 1.0, 2.0, 1.0]), np.array([0.0, 1.0, 0.0, -1.0]), 1.0)
    assert few.low <= 1 <= few.high
    assert few.sigma > 0.2


# ---- flat ---------------------------------------------------------------------------------------


def test_a_card_is_placed_by_the_paper_s_formula():
    rng = np.random.default_rng(3)
    for _ in range(15):
        width_m, depth = rng.uniform(0.02, 0.05), rng.uniform(0.15, 0.6)
        pose = look_at(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3))
        camera = Camera.pinhole(640, 480, F, pose)
        width = F * width_m / depth
        middle = rng.uniform([width, width], [640 - width, 480 - width])
        image = card(width, width * 0.9, middle, noise=2.0, rng=rng, light=1.5)
        (it,) = see(image, camera, [ColourTarget("card", GREEN, width_m)])
        assert it.depth_m == pytest.approx(depth, rel=0.015)
        expected = camera.deproject(middle, depth)
        np.testing.assert_allclose(it.p_base, expected, atol=0.01 * depth)
        np.testing.assert_allclose(camera.to_base(it.p_camera), it.p_base, atol=1e-12)
        assert it.p_camera[2] == it.depth_m
        left, top, right, bottom = it.outline_px
        assert right - left == pytest.approx(width, abs=2.5)
        u, v, w, h = it.box_px
        assert np.abs([left - u, top - v, right - u - w, bottom - v - h]).max() < 3


def test_sigma_grows_with_the_square_of_distance_and_with_doubt_about_the_width():
    camera = Camera.pinhole(640, 480, F)
    sigmas = []
    for depth in (0.2, 0.4):
        size = F * 0.04 / depth
        image = card(size, size, (320, 240), light=1.5)
        (it,) = see(image, camera, [ColourTarget("card", GREEN, 0.04)])
        doubtful = ColourTarget("card", GREEN, 0.04, width_sigma_m=0.004)
        (doubted,) = see(image, camera, [doubtful])
        assert doubted.depth_sigma_m == pytest.approx(
            math.hypot(0.1 * depth, it.depth_sigma_m), rel=0.05
        )
        assert it.depth_sigma_m <= it.sigma_m < 1.5 * it.depth_sigma_m
        sigmas.append(it.depth_sigma_m)
    assert sigmas[1] / sigmas[0] == pytest.approx(4, rel=0.3)


# ---- round --------------------------------------------------------------------------------------


def draw_one(solid, camera, name="green"):
    table = Table(height=solid.centre[2] - solid.half_height)
    scene = Scene((solid,), table, noise=0.0)
    return draw(scene, camera.camera_matrix, camera.transform_base_camera, 640, 480)


@pytest.mark.parametrize("spot", [(320, 240), (110, 90), (530, 390), (500, 100)])
@pytest.mark.parametrize("depth", [0.16, 0.35, 0.6])
def test_balls_are_placed_by_their_centre_even_far_off_the_axis(spot, depth):
    camera = Camera.pinhole(640, 480, F, look_at((0, 0, 0.3), (0.3, 0.1, 0.0)))
    centre = camera.deproject(spot, depth)
    image = draw_one(Ball(tuple(centre), 0.02, PAINT["green"]), camera)
    (it,) = see(image, camera, {"green": ColourTarget("green", GREEN, 0.04, "ball")})
    assert it.depth_m == pytest.approx(depth, rel=0.012)
    np.testing.assert_allclose(it.p_base, centre, atol=0.012 * depth)


@pytest.mark.parametrize("drop", [0.02, 0.12, 0.25, 0.31])
@pytest.mark.parametrize("height", [0.02, 0.06])
def test_upright_cylinders_are_placed_by_their_centre_from_any_height(drop, height):
    centre = np.array([0.2, -0.05, 0.0])
    camera = Camera.pinhole(640, 480, F, look_at((0.02, 0.05, drop), np.add(centre, [0, 0.02, 0])))
    image = draw_one(Cylinder(tuple(centre), 0.015, height, PAINT["red"]), camera)
    (it,) = see(image, camera, [ColourTarget("red", RED, 0.03, "cylinder")])
    np.testing.assert_allclose(it.p_base, centre, atol=0.004)


def test_a_cylinder_below_the_camera_is_a_disc_that_faces_it():
    camera = Camera.pinhole(640, 480, F, look_at((0.2, 0, 0.3), (0.2, 0.0, 0.0)))
    image = draw_one(Cylinder((0.2, 0.0, 0.0), 0.02, 0.04, PAINT["green"]), camera)
    (it,) = see(image, camera, [ColourTarget("green", GREEN, 0.04, "cylinder")])
    np.testing.assert_allclose(it.p_base, [0.2, 0, 0.02], atol=0.004)  # its top


def test_half_a_ball_is_refused_rather_than_mismeasured():
    camera = Camera.pinhole(640, 480, F, look_at((0, 0, 0.1), (0.3, 0, 0.0)))
    image = draw_one(Ball((0.3, 0, 0), 0.03, PAINT["green"]), camera)
    image[:, 320:420] = (120, 120, 120)
    target = ColourTarget("green", GREEN, 0.06, "ball")
    view = look(image, camera, [target])
    assert view.located == ()
    assert [(it.target, it.reason) for it in view.refused] == [("green", Refusal.PARTIAL)]


# ---- the whole eye ------------------------------------------------------------------------------


def test_several_colours_at_once_the_largest_first():
    camera = Camera.pinhole(640, 480, F)
    image = card(60, 60, (150, 200))
    image[200:240, 400:440] = (40, 30, 200)
    image[300:330, 500:530] = (40, 30, 200)
    targets = [ColourTarget("red", RED, 0.03), ColourTarget("green", GREEN, 0.03)]
    found = see(image, camera, targets)
    assert [it.target for it in found] == ["green", "red", "red"]
    assert found == see(image, camera, {it.name: it for it in targets}) or len(found) == 3
    assert found[1].depth_m < found[2].depth_m


def test_what_the_border_cuts_is_refused():
    camera = Camera.pinhole(640, 480, F)
    image = card(60, 60, (10, 200))
    view = look(image, camera, [ColourTarget("green", GREEN, 0.03)])
    assert view.located == ()
    (it,) = view.refused
    assert it.reason is Refusal.BORDER
    assert it.box_px[0] == 0


@pytest.mark.parametrize("shade", [0, 255])
def test_nothing_seen_is_an_answer(shade):
    image = np.full((480, 640, 3), shade, np.uint8)
    view = look(image, Camera.pinhole(640, 480, F), [ColourTarget("green", GREEN, 0.03)])
    assert view == type(view)((), ())
    assert see(image, Camera.pinhole(640, 480, F), []) == ()


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(InputError, match="320 x 240 px and the camera is calibrated for 640 x 480"):
        see(np.zeros((240, 320, 3), np.uint8), Camera.pinhole(640, 480, F), [])


def test_distortion_is_taken_out_of_the_width():
    matrix = intrinsics(F, F, 319.5, 239.5)
    distortion = np.array([-0.35, 0.15, 0.0, 0.0, 0.0])
    bent = Camera(640, 480, matrix, distortion, np.eye(4))
    straight = Camera(640, 480, matrix, np.zeros(0), np.eye(4))
    width_m, depth = 0.05, 0.3
    middle = np.array([0.11, 0.06, depth])
    corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    edge = np.linspace(0, 1, 40, endpoint=False)[:, None]
    square = np.array(corners) * width_m / 2
    ends = np.roll(square, -1, axis=0)
    loop = np.concatenate([square[k] + (ends[k] - square[k]) * edge for k in range(4)])
    points = np.column_stack([loop + middle[:2], np.full(len(loop), depth)])
    large = np.zeros((480 * 8, 640 * 8), np.uint8)
    cv2.fillPoly(large, [np.rint((bent.project(points) + 0.5) * 8 - 0.5).astype(np.int32)], 255)
    share = cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA)[..., None] / 255
    image = np.rint(share * [30, 150, 40] + (1 - share) * 170).astype(np.uint8)
    target = ColourTarget("card", GREEN, width_m)
    (it,) = see(image, bent, [target])
    np.testing.assert_allclose(it.p_camera, middle, atol=0.006)
    (wrong,) = see(image, straight, [target])
    assert abs(wrong.depth_m - depth) > 2 * abs(it.depth_m - depth)


def test_results_are_frozen_to_the_buffer():
    image = card(60, 60, (150, 200))
    (it,) = see(image, Camera.pinhole(640, 480, F), [ColourTarget("green", GREEN, 0.03)])
    assert isinstance(it, Located)
    for array in (it.p_camera, it.p_base, it.covariance_base):
        assert not array.flags.writeable
    np.testing.assert_allclose(it.covariance_base, it.covariance_base.T)
    assert (np.linalg.eigvalsh(it.covariance_base) > 0).all()


# ---- the focal length from a picture ------------------------------------------------------------


def test_the_focal_length_comes_from_one_picture():
    rng = np.random.default_rng(4)
    for _ in range(20):
        focal, distance = rng.uniform(400, 900), rng.uniform(0.2, 0.5)
        image = card(focal * 0.05 / distance, 50, rng.uniform([200, 150], [400, 300]), light=1.5)
        found = focal_from_picture(image, GREEN, distance, 0.05)
        assert isinstance(found, FocalReference)
        assert found.focal_px == pytest.approx(focal, rel=0.01)
        assert abs(found.focal_px - focal) < 4 * found.sigma_px


def test_the_focal_length_of_a_ball_counts_its_silhouette():
    camera = Camera.pinhole(640, 480, F, look_at((0, 0, 0.0), (1, 0, 0.0)))
    image = draw_one(Ball((0.18, 0, 0), 0.025, PAINT["green"]), camera)
    found = focal_from_picture(image, GREEN, 0.18, 0.05, shape="ball")
    assert found.focal_px == pytest.approx(F, rel=0.01)


def test_no_whole_object_gives_no_focal_length():
    assert focal_from_picture(np.zeros((48, 64, 3), np.uint8), GREEN, 0.3, 0.05) is None
    assert focal_from_picture(card(60, 60, (10, 200)), GREEN, 0.3, 0.05) is None
    with pytest.raises(InputError, match="distance_m is 0"):
        focal_from_picture(np.zeros((48, 64, 3), np.uint8), GREEN, 0, 0.05)


# ---- anything at all ----------------------------------------------------------------------------


def scribble(rng):
    """Draw shapes of any kind and colour on a picture of any size."""
    height, width = rng.integers(5, 200, 2)
    image = np.full((height, width, 3), rng.integers(0, 256, 3), np.uint8)
    for _ in range(rng.integers(0, 8)):
        colour = tuple(int(x) for x in rng.integers(0, 256, 3))
        first, second, third = (tuple(int(x) for x in rng.integers(0, 200, 2)) for _ in range(3))
        match rng.integers(4):
            case 0:
                cv2.rectangle(image, first, second, colour, -1)
            case 1:
                cv2.circle(image, first, int(rng.integers(1, 60)), colour, -1)
            case 2:
                cv2.line(image, first, second, colour, int(rng.integers(1, 9)))
            case _:
                cv2.fillPoly(image, [np.array([first, second, third])], colour)
    noisy = image + rng.normal(0, rng.choice([0, 3, 30]), image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def test_whatever_is_seen_is_finite_ahead_and_uncertain():
    rng = np.random.default_rng(5)
    reasons, count = set(), 0
    for _ in range(400):
        image = scribble(rng)
        height, width = image.shape[:2]
        pose = look_at(rng.normal(size=3), rng.normal(size=3))
        camera = Camera.pinhole(width, height, rng.uniform(20, 800), pose)
        low, high = rng.integers(0, 180, 2)
        bounds = HsvRange((low, *rng.integers(0, 120, 2)), (high, 255, 255))
        targets = [ColourTarget(it, bounds, 0.05, it) for it in ("flat", "ball", "cylinder")]
        settings = BlobSettings(min_area_px=float(rng.choice([0, 100])))
        view = look(image, camera, targets, settings)
        for it in view.located:
            assert np.isfinite(it.p_base).all()
            assert 0 < it.depth_sigma_m <= it.sigma_m * (1 + 1e-9)
            assert it.depth_m > 0
        count += len(view.located)
        reasons |= {it.reason for it in view.refused}
        focal_from_picture(image, bounds, 0.3, 0.05, settings=settings)
    assert count > 15
    assert reasons == set(Refusal) - {Refusal.AFLOAT}  # there is no table
