"""The drawn world against geometry worked out by hand."""

import math

import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.sim.scene import Light, Scene, draw
from arm3dof.sim.shapes import Ball, Box, Cylinder
from arm3dof.sim.table import Table
from arm3dof.vision.camera import Camera, look_at

RED = (0.85, 0.1, 0.1)
LOOK = look_at((0.0, 0.0, 0.2), (0.3, 0.0, 0.0))
CAMERA = Camera.pinhole(320, 240, 300, LOOK)
SOLIDS = (
    Ball((0.3, 0.02, 0.03), 0.03, RED),
    Cylinder((0.3, 0.02, 0.03), 0.02, 0.06, RED),
    Box((0.3, 0.02, 0.03), (0.04, 0.05, 0.06), 0.4, RED),
)


def picture(scene, camera=CAMERA, rng=None):
    return draw(
        scene,
        camera.camera_matrix,
        camera.transform_base_camera,
        camera.width,
        camera.height,
        rng,
    )


def directions(rng, count):
    rays = rng.normal(size=(3, count))
    return rays / np.linalg.norm(rays, axis=0)


def depth_inside(solid, points):
    """How deep points (3, n) lie in a solid; 0 on its surface, negative outside."""
    x, y, z = points - np.array(solid.centre)[:, None]
    match solid:
        case Ball():
            return solid.radius - np.sqrt(x * x + y * y + z * z)
        case Cylinder():
            return np.minimum(solid.radius - np.hypot(x, y), solid.height / 2 - np.abs(z))
        case Box():
            c, s = math.cos(solid.yaw), math.sin(solid.yaw)
            sides = np.array([c * x + s * y, c * y - s * x, z])
            return (np.array(solid.size)[:, None] / 2 - np.abs(sides)).min(axis=0)


@pytest.mark.parametrize("solid", SOLIDS)
def test_rays_meet_the_surface_and_nothing_before_it(solid):
    rng = np.random.default_rng(0)
    eye = np.array(solid.centre)[:, None] + 0.2 * directions(rng, 4000)
    aim = np.array(solid.centre)[:, None] + 0.06 * rng.normal(size=(3, 4000))
    rays = aim - eye
    hit = solid.meet(eye, rays)
    met = np.isfinite(hit.distance)
    assert 400 < met.sum() < 3600
    points = eye[:, met] + rays[:, met] * hit.distance[met]
    np.testing.assert_allclose(depth_inside(solid, points), 0, atol=1e-9)
    along = np.linspace(0, 3, 600)
    for k in range(200):  # march along: inside begins at the hit, and never where there is none
        march = depth_inside(solid, eye[:, [k]] + rays[:, [k]] * along)
        inside = np.flatnonzero(march > 1e-3)
        if met[k]:
            assert len(inside) == 0 or along[inside[0]] >= hit.distance[k]
        else:
            assert len(inside) == 0
    normals = solid.normals(points, hit.face[met])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=0), 1, atol=1e-9)
    assert ((normals * rays[:, met]).sum(axis=0) <= 1e-9).all()
    assert (depth_inside(solid, points - 1e-4 * normals) > 0).all()
    assert (
        np.linalg.norm(points - np.array(solid.centre)[:, None], axis=0)
        <= solid.bounding_radius + 1e-9
    ).all()


@pytest.mark.parametrize("solid", SOLIDS)
def test_rays_along_the_axes_and_away_are_met_and_missed(solid):
    centre = np.array(solid.centre)[:, None]
    for axis in range(3):
        for sign in (-1.0, 1.0):
            ray = np.zeros((3, 1))
            ray[axis] = sign
            assert np.isfinite(solid.meet(centre - ray, ray).distance).all()
            assert np.isinf(solid.meet(centre + ray, ray).distance).all()
            aside = np.roll(ray, 1, axis=0)
            assert np.isinf(solid.meet(centre - ray + aside, ray).distance).all()


def test_a_silhouette_falls_where_the_pinhole_puts_it():
    """A ball's silhouette is bounded by the cone of angle asin(R / D) about its centre."""
    ball = Ball((0.32, 0.05, 0.05), 0.04, RED)
    scene = Scene((ball,), Table(height=0.01), noise=0)
    with_ball = picture(scene).astype(int)
    red = with_ball[:, :, 2] - with_ball[:, :, 1] > 60
    v, u = np.mgrid[0:240, 0:320]
    rays = CAMERA.rays(np.column_stack([u.ravel(), v.ravel()]))
    centre = CAMERA.to_camera(np.array(ball.centre))
    cosine = rays @ centre / np.linalg.norm(rays, axis=1) / np.linalg.norm(centre)
    angle = np.arccos(cosine).reshape(240, 320)
    cone = math.asin(ball.radius / np.linalg.norm(centre))
    pixel = 1 / 300
    assert red[angle < cone - pixel].all()
    assert not red[angle > cone + pixel].any()


def test_edges_are_smooth():
    """The share of an edge pixel that a thing covers is seen in its colour."""
    card = Box((0.3, 0.0, 0.0), (0.001, 0.05, 0.1), 0.0, (0.9, 0.1, 0.1))
    camera = Camera.pinhole(320, 240, 300, look_at((0, 0, 0), (1, 0, 0)))
    levels = set()
    for shift in np.linspace(0, 1, 9):
        moved = Box((0.3, shift / 1000, 0.0), card.size, 0.0, card.colour)
        row = picture(Scene((moved,), Table(height=-0.05), noise=0), camera)[120, :, 1]
        levels.add(int(row[128:139].astype(int).sum() // 40))
    assert len(levels) >= 4


def test_what_is_nearer_hides_what_is_behind():
    near, far = Ball((0.2, 0, 0.1), 0.02, (0.1, 0.1, 0.9)), Ball((0.35, 0, 0.02), 0.03, RED)
    camera = Camera.pinhole(160, 120, 150, look_at((0, 0, 0.2), near.centre))
    for solids in ((near, far), (far, near)):
        blue, _, red = picture(Scene(solids, Table(height=-0.01), noise=0), camera)[60, 80]
        assert blue > red + 50


def test_a_shadow_lies_away_from_the_lamp_and_is_softer_for_a_larger_one():
    ball = Ball((0.3, 0.0, 0.06), 0.02, RED)
    camera = Camera.pinhole(320, 320, 500, look_at((0.3, 0, 0.5), (0.3, 0, 0)))

    def brightness(light):
        scene = Scene((ball,), Table(height=0.0), light, noise=0)
        with_ball = picture(scene, camera).astype(float).sum(axis=2)
        bare = picture(Scene((), Table(height=0.0), light, noise=0), camera).astype(float)
        return with_ball / bare.sum(axis=2)

    sharp = brightness(Light(direction=(0, 1, 1), softness=0.01))
    spot = camera.project([0.3, -0.06, 0.0]).round().astype(int)
    other = camera.project([0.3, 0.06, 0.0]).round().astype(int)
    assert sharp[spot[1], spot[0]] < 0.8
    assert sharp[other[1], other[0]] > 0.97
    soft = brightness(Light(direction=(0, 1, 1), softness=0.2))
    profile = slice(spot[0] - 40, spot[0] + 41)
    steep = [np.abs(np.diff(it[spot[1], profile])).max() for it in (sharp, soft)]
    assert steep[1] < steep[0]


def test_one_thing_shades_another():
    lamp = Light(direction=(0, 1, 0.35), softness=0.05)
    lit, wall = (
        Ball((0.3, -0.03, 0.02), 0.02, RED),
        Box((0.3, 0.03, 0.04), (0.08, 0.01, 0.08), 0, RED),
    )
    alone, shaded = (
        picture(Scene(solids, Table(height=0.0), lamp, noise=0)) for solids in ((lit,), (lit, wall))
    )
    u, v = CAMERA.project([0.29, -0.02, 0.03]).round().astype(int)
    assert int(shaded[v, u, 2]) < int(alone[v, u, 2]) - 20


def test_more_light_is_brighter_and_noise_is_as_told():
    dim, bright = (
        picture(Scene(SOLIDS[:1], light=Light(strength=s), noise=0)).mean() for s in (0.3, 0.6)
    )
    assert bright > dim + 15
    plain = picture(Scene((), light=Light(strength=0.4), noise=0)).astype(float)
    noisy = picture(Scene((), light=Light(strength=0.4), noise=6.0), rng=np.random.default_rng(0))
    assert (noisy - plain).std() == pytest.approx(6.0, rel=0.05)
    assert (noisy - plain).mean() == pytest.approx(0, abs=0.2)


def test_the_same_seed_draws_the_same_picture():
    scene = Scene(SOLIDS[:2])
    first, second = (picture(scene, rng=np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, picture(scene, rng=np.random.default_rng(4)))


def test_odd_places_of_camera_and_things():
    inside = Camera.pinhole(64, 48, 60, look_at((0.3, 0, 0.03), (0.5, 0, 0.03)))
    behind = Camera.pinhole(64, 48, 60, look_at((0.6, 0, 0.1), (0.9, 0, 0.1)))
    under = Camera.pinhole(64, 48, 60, look_at((0.3, 0, -0.5), (0.3, 0.1, 0.0)))
    close = Camera.pinhole(64, 48, 60, look_at((0.3, 0.07, 0.03), (0.5, 0.07, 0.03)))
    for camera in (inside, behind, under, close):
        for table in (Table(), Table(height=0.0), Table(height=0.2)):
            image = picture(Scene(SOLIDS, table, noise=0), camera)
            assert image.shape == (48, 64, 3)
            assert image.dtype == np.uint8
    wall_only = picture(Scene((), Table(half_size=(0.01, 0.01)), noise=0), behind)
    assert np.ptp(wall_only[:, 5].astype(int), axis=1).max() < 30  # grey
    assert draw(Scene(SOLIDS), np.eye(3), np.eye(4), 1, 1).shape == (1, 1, 3)


def test_a_lamp_at_the_horizon_still_lights():
    image = picture(Scene(SOLIDS, light=Light(direction=(1, 0, 0.01), softness=0.3), noise=0))
    assert image.mean() > 20


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ball((0, 0, 0), 0.0, RED), "radius is 0.0"),
        (lambda: Ball((0, 0, math.nan), 0.1, RED), "finite metres"),
        (lambda: Ball((0, 0, 0), 0.1, (2, 0, 0)), "from 0 to 1"),
        (lambda: Cylinder((0, 0, 0), 0.1, -1, RED), "height is -1"),
        (lambda: Box((0, 0, 0), (1, 0, 1), 0, RED), "width is 0"),
        (lambda: Light(direction=(0, 0, -1)), "above the table"),
        (lambda: Light(strength=-1), "strength is -1"),
        (lambda: Light(softness=math.nan), "softness is nan"),
        (lambda: draw(Scene(()), np.eye(3), np.eye(4), 0, 5), "0 x 5 px"),
        (lambda: draw(Scene(()), np.eye(2), np.eye(4), 5, 5), "camera_matrix has shape"),
    ],
)
def test_what_cannot_be_drawn_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
