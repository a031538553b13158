"""Pictures of the simulated world: geometry to half a pixel, light, lens, noise and blur."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from arm3dof.errors import ArmError, InputError
from arm3dof.model.library import load_robot
from arm3dof.sim import renderer
from arm3dof.sim.lens import Lens
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.world import COLOURS, Body, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.state import JointState
from arm3dof.vision.camera import Camera, intrinsics, look_at

MATRIX = intrinsics(310.0, 325.0, 171.3, 108.6)  # the principal point is far from the middle
WIDTH, HEIGHT = 320, 240
POSE = look_at([0.55, -0.20, 0.22], [0.2, 0.0, -0.08])
PLACES = ((0.17, -0.15), (0.17, 0.17), (0.36, -0.02))
COINS = tuple(
    Body(f"coin_{i}", "cylinder", 0.04, 0.002, 0.02, COLOURS["red"], *place)
    for i, place in enumerate(PLACES)
)
ZEROS = np.zeros(3)
ASIDE = JointState(0.0, np.array([2.2, 1.6, -0.5]), ZEROS)


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


def plant_with(robot, *bodies, **world):
    plant = MujocoPlant(robot, World(bodies=bodies, **world))
    plant.reset(ASIDE)
    return plant


@pytest.fixture(scope="module")
def coins(robot):
    return plant_with(robot, *COINS)


def picture_of(plant, **options):
    with WorldCamera(plant, MATRIX, POSE, WIDTH, HEIGHT, **options) as camera:
        return camera.take()


@pytest.fixture(scope="module")
def plain(coins):
    """The coins without shadows, seen through a straight lens without noise."""
    picture = picture_of(coins, shadows=False)
    picture.flags.writeable = False
    return picture


def middles(picture):
    """Return the centres of the red patches, shape (n, 2), leftmost first."""
    blue, green, red = (picture[..., k].astype(int) for k in range(3))
    mask = ((red > 90) & (red > 2 * green) & (red > 2 * blue)).astype(np.uint8)
    count, _, stats, centres = cv2.connectedComponentsWithStats(mask)
    large = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] > 60]
    return np.array(sorted(centres[k].tolist() for k in large))


def expected_middles(camera):
    """Return the centroid of each coin's top as a camera projects it, leftmost first."""
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    found = []
    for x, y in PLACES:
        rim = np.column_stack(
            [x + 0.02 * np.cos(turn), y + 0.02 * np.sin(turn), np.full(turn.size, -0.108)]
        )
        moments = cv2.moments(camera.project(rim).astype(np.float32).reshape(-1, 1, 2))
        found.append([moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]])
    return np.array(sorted(found))


def test_a_pixel_is_where_the_eyes_camera_says(plain):
    camera = Camera(WIDTH, HEIGHT, MATRIX, np.zeros(0), POSE)
    np.testing.assert_allclose(middles(plain), expected_middles(camera), atol=0.5)


@pytest.mark.parametrize(
    "distortion",
    [(-0.25, 0.08, 0.002, -0.003), (0.15, 0.02, 0, 0, 0.01), (0.1, 0, 0, 0, 0, 0.3, 0, 0)],
)
def test_the_lens_bends_as_the_eyes_camera_says(coins, plain, distortion):
    camera = Camera(WIDTH, HEIGHT, MATRIX, np.array(distortion), POSE)
    seen = middles(picture_of(coins, distortion=distortion, shadows=False))
    assert np.abs(seen - middles(plain)).max() > 1.0
    np.testing.assert_allclose(seen, expected_middles(camera), atol=0.5)


def test_a_moved_camera_sees_from_its_new_place(coins):
    there = look_at([0.05, 0.1, 0.5], [0.2, 0.0, -0.1])
    with WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT, shadows=False) as camera:
        camera.take()
        camera.transform_base_camera = there
        seen = middles(camera.take())
    expected = expected_middles(Camera(WIDTH, HEIGHT, MATRIX, np.zeros(0), there))
    np.testing.assert_allclose(seen, expected, atol=0.5)


def test_light_brightens_and_dims(robot):
    means = [picture_of(plant_with(robot, *COINS, light=light)).mean() for light in (0.3, 1.0, 2.0)]
    assert 20 < means[0] < 0.4 * means[1] < means[1] < means[2] < 250


def test_a_plain_table_has_no_grain(robot):
    grain, plain = (picture_of(plant_with(robot, surface=name)) for name in ("wood", "plain"))
    patch = (slice(150, 230), slice(20, 120))  # of the table
    assert plain[patch].std(axis=(0, 1)).max() < 0.6 * grain[patch].std(axis=(0, 1)).min()
    assert np.ptp(plain[patch].mean(axis=(0, 1))) < 15


def test_shadows_darken_the_table(robot):
    plant = plant_with(robot, Body("post", "cylinder", 0.03, 0.10, 0.1, COLOURS["blue"], 0.2, 0.0))
    bare = picture_of(plant, shadows=False).astype(int)
    shaded = picture_of(plant, shadows=True).astype(int)
    darker = (bare - shaded).max(axis=2) > 25
    assert 300 < darker.sum() < 20_000


def test_noise_has_its_deviation_and_differs(coins, plain):
    rng = np.random.default_rng(1)
    clean = plain.astype(int)
    with WorldCamera(
        coins, MATRIX, POSE, WIDTH, HEIGHT, shadows=False, noise=4.0, rng=rng
    ) as camera:
        first, second = camera.take().astype(int), camera.take().astype(int)
    inside = (clean > 30) & (clean < 225)
    assert np.std((first - clean)[inside]) == pytest.approx(4.0, rel=0.1)
    assert np.std((first - second)[inside]) == pytest.approx(4.0 * np.sqrt(2), rel=0.1)


def test_what_moves_is_blurred_and_what_stands_is_not(robot):
    plant = plant_with(robot, *COINS)
    still = picture_of(plant, shadows=False, exposure=0.05)
    np.testing.assert_array_equal(still, picture_of(plant, shadows=False))
    plant.data.joint("coin_1").qvel[0] = 0.6  # 3 cm in the exposure
    moved = picture_of(plant, shadows=False, exposure=0.05).astype(int)
    changed = np.abs(moved - still).max(axis=2) > 12
    rows, columns = np.nonzero(changed)
    assert changed.sum() > 200
    pixels = Camera(WIDTH, HEIGHT, MATRIX, np.zeros(0), POSE).project([*PLACES[1], -0.108])
    assert np.hypot(np.median(columns) - pixels[0], np.median(rows) - pixels[1]) < 40


def test_taking_a_picture_changes_nothing_in_the_world(coins):
    before = coins.data.qpos.copy()
    with WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT) as camera:
        first = camera.take()
        np.testing.assert_array_equal(camera.take(), first)
    np.testing.assert_array_equal(coins.data.qpos, before)
    assert first.shape == (HEIGHT, WIDTH, 3)
    assert first.dtype == np.uint8


@pytest.mark.slow
def test_cameras_that_are_dropped_leave_the_others_their_pictures(coins):
    wanted = picture_of(coins)
    for _ in range(4):
        first = WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT)
        second = WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT)
        for camera in (first, second, first):
            np.testing.assert_array_equal(camera.take(), wanted)
    kept = [first]
    del first, camera
    with ThreadPoolExecutor() as other:  # the collector may run in any thread
        other.submit(kept.clear).result()
    np.testing.assert_array_equal(second.take(), wanted)
    second.close()
    second.close()


def test_a_camera_belongs_to_its_thread(coins):
    with WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT) as camera, ThreadPoolExecutor() as other:
        with pytest.raises(InputError, match="made in another thread; make one in the thread"):
            other.submit(camera.take).result()
        assert camera.take().std() > 10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": -1.0}, "noise is -1.0; give 0 or more"),
        ({"noise": 2.0}, "give rng=numpy.random.default_rng"),
        ({"exposure": np.nan}, "exposure is nan"),
        ({"distortion": (0.1, 0.2)}, "give 4, 5 or 8 finite coefficients"),
        ({"distortion": (-3.0, 0.0, 0.0, 0.0)}, "folds the picture"),
    ],
)
def test_impossible_cameras_are_refused(coins, options, message):
    with pytest.raises(InputError, match=message):
        WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT, **options)


def test_impossible_intrinsics_are_refused(coins):
    with pytest.raises(InputError, match="the picture is 0 x 240 px"):
        WorldCamera(coins, MATRIX, POSE, 0, HEIGHT)
    skewed = MATRIX.copy()
    skewed[0, 1] = 3.0
    with pytest.raises(InputError, match="no skew"):
        WorldCamera(coins, skewed, POSE, WIDTH, HEIGHT)


def test_a_lens_that_bends_nothing_changes_nothing():
    picture = np.random.default_rng(0).integers(0, 255, (60, 80, 3), dtype=np.uint8)
    matrix = intrinsics(70.0, 70.0, 40.0, 30.0)
    lens = Lens(matrix, np.zeros(4), 80, 60)
    wide = np.zeros((lens.height, lens.width, 3), np.uint8)
    left, top = int(lens.matrix[0, 2] - 40), int(lens.matrix[1, 2] - 30)
    wide[top : top + 60, left : left + 80] = picture
    np.testing.assert_array_equal(lens.bend(wide), picture)


# ---- what it draws with ------------------------------------------------------------------------


def test_without_a_renderer_one_line_names_the_cure(monkeypatch):
    monkeypatch.setattr(renderer, "BACKENDS", ("no_such_backend",))
    renderer.backend.cache_clear()
    before = dict(os.environ)
    with pytest.raises(ArmError, match=r"nothing to draw with .* libegl1 .*libosmesa6"):
        renderer.backend()
    assert dict(os.environ) == before
    renderer.backend.cache_clear()


def test_a_renderer_that_does_not_exist_is_one_line():
    program = "import sys; from arm3dof.cli import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", program, "simulate", "--plant", "mujoco"],
        env={**os.environ, "MUJOCO_GL": "nonsense"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: MUJOCO_GL is 'nonsense'")
    assert done.stderr.count("\n") == 1


DRAW = """
import numpy as np
from arm3dof.model.library import load_robot
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.renderer import backend
from arm3dof.sim.world_camera import WorldCamera
pose = np.array([[0, 0, -1, 0.6], [1, 0, 0, 0], [0, -1, 0, 0.05], [0, 0, 0, 1.0]])
matrix = np.array([[80.0, 0, 40], [0, 80.0, 30], [0, 0, 1]])
with WorldCamera(MujocoPlant(load_robot()), matrix, pose, 80, 60) as camera:
    print(backend()[0], camera.take().std() > 10)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["egl", "osmesa"])
def test_either_backend_draws(name):
    done = subprocess.run(
        [sys.executable, "-c", DRAW],
        env={**os.environ, "MUJOCO_GL": name, "PYOPENGL_PLATFORM": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout.split(), done.stderr) == ([name, "True"], "")


# ---- drawn onto the last picture -----------------------------------------------------------------


@pytest.mark.parametrize("smooth", [True, False])
def test_a_picture_onto_the_last_one_is_a_whole_one(robot, smooth):
    plant = plant_with(robot, *COINS)
    rng = np.random.default_rng(0)
    options = {"shadows": False, "smooth": smooth}
    with (
        WorldCamera(plant, MATRIX, POSE, WIDTH, HEIGHT, **options) as whole,
        WorldCamera(plant, MATRIX, POSE, WIDTH, HEIGHT, onto_last=True, **options) as onto,
    ):
        for turn in range(8):
            plant.reset(JointState(0.0, rng.uniform([-1.5, 0.2, -2.0], [1.5, 2.0, 0.0]), ZEROS))
            if turn % 3 == 0:
                plant.data.joint("coin_1").qpos[:2] += rng.uniform(-0.03, 0.03, 2)
            change = np.abs(whole.take().astype(int) - onto.take()).max(axis=2)
            assert (change > 2).sum() <= 5  # single pixels of edges
        there = look_at([0.05, 0.1, 0.5], [0.2, 0.0, -0.1])
        whole.transform_base_camera = onto.transform_base_camera = there
        change = np.abs(whole.take().astype(int) - onto.take()).max(axis=2)
        assert (change > 2).sum() <= 5


def test_only_what_has_moved_is_drawn(robot, monkeypatch):
    drawn = []
    draw = renderer.Renderer.draw

    def noted(self, data, matrix, pose, window=None):
        drawn.append(window)
        return draw(self, data, matrix, pose, window)

    monkeypatch.setattr(renderer.Renderer, "draw", noted)
    plant = plant_with(robot, *COINS)
    with WorldCamera(plant, MATRIX, POSE, WIDTH, HEIGHT, shadows=False, onto_last=True) as camera:
        first = camera.take()
        assert drawn == [(0, 0, WIDTH, HEIGHT)]
        first[:] = 0  # it belongs to who asked
        np.testing.assert_array_equal(camera.take(), picture_of(plant, shadows=False))
        del drawn[1:]
        plant.data.joint("coin_1").qpos[0] += 0.01
        camera.take()
    window = drawn[1]
    middle = Camera(WIDTH, HEIGHT, MATRIX, np.zeros(0), POSE).project([*PLACES[1], -0.108])
    assert window.left < middle[0] < window.right
    assert window.top < middle[1] < window.bottom
    assert window.right - window.left < 70
    assert window.bottom - window.top < 70


def test_shadows_are_not_drawn_onto_the_last_picture(coins):
    with pytest.raises(InputError, match="onto_last goes without shadows"):
        WorldCamera(coins, MATRIX, POSE, WIDTH, HEIGHT, onto_last=True)
