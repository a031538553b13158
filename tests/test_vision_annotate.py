import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.vision.annotate import BLUE, RED, annotate, label
from arm3dof.vision.locate import Located, Refused, View
from arm3dof.vision.placing import Refusal


def located(box, target="green", depth=0.25):
    u, v, w, h = box
    return Located(
        target=target,
        box_px=box,
        outline_px=(u - 0.4, v - 0.5, u + w - 0.6, v + h - 0.4),
        depth_m=depth,
        depth_sigma_m=0.001,
        p_camera=[0.0123, -0.045, depth],
        p_base=[0.1, 0.1, 0.1],
        covariance_base=np.eye(3) * 1e-6,
    )


def share(image, colour, box):
    """How much of a box's rim, three pixels to each side, has nearly a colour."""
    u, v, w, h = box
    near = np.abs(image.astype(int) - colour).max(axis=2) < 60
    rim = np.zeros(near.shape, bool)
    rim[max(v - 3, 0) : v + h + 3, max(u - 3, 0) : u + w + 3] = True
    rim[v + 3 : v + h - 3, u + 3 : u + w - 3] = False
    return near[rim].sum() / (2 * (w + h))


def test_the_frames_are_blue_and_red_and_nearly_overlap():
    image = np.full((480, 640, 3), 170, np.uint8)
    box = (200, 220, 60, 80)
    drawn = annotate(image, View((located(box),), ()))
    assert drawn.shape == image.shape
    assert (image == 170).all()
    assert share(drawn, BLUE, box) > 0.8
    assert share(drawn, RED, box) > 0.8


def test_the_label_is_the_paper_s():
    assert label(located((1, 1, 5, 5))) == "green (1.2, -4.5, 25.0) cm"
    for reason in Refusal:
        assert label(Refused("red", (1, 1, 5, 5), reason)).startswith("red: ")


def test_refused_patches_are_drawn_without_a_depth_frame():
    image = np.full((480, 640, 3), 170, np.uint8)
    box = (0, 220, 60, 80)
    for seen in (
        View((), (Refused("red", box, Refusal.BORDER),)),
        [Refused("red", box, Refusal.BORDER)],
    ):
        drawn = annotate(image, seen)
        assert share(drawn, RED, box) < 0.05
        assert (drawn != image).any()


@pytest.mark.parametrize(
    "shape", [(1, 1), (3, 500), (40, 30), (120, 160), (480, 640), (2000, 3000)]
)
def test_any_size_is_drawn_and_small_pictures_are_enlarged(shape):
    image = np.full((*shape, 3), 170, np.uint8)
    height, width = shape
    box = (width // 3, height // 3, max(width // 3, 1), max(height // 3, 1))
    drawn = annotate(image, [located(box, "a target with quite a long name")])
    assert max(drawn.shape) >= 480
    assert drawn.shape[0] % height == 0
    assert drawn.shape[0] // height == drawn.shape[1] // width
    assert (drawn != 170).any()


def test_labels_keep_clear_of_each_other_and_of_other_frames():
    image = np.full((480, 640, 3), 170, np.uint8)
    rng = np.random.default_rng(0)
    for _ in range(10):
        u, v = rng.integers(150, 350, 2)
        boxes = [(u, v, 50, 50), (u + 55, v, 50, 50), (u + 25, v + 56, 50, 50)]
        seen = [located(tuple(int(x) for x in box)) for box in boxes]
        drawn = annotate(image, seen)
        for u, v, w, h in boxes:
            assert (drawn[v + 5 : v + h - 5, u + 5 : u + w - 5] == 170).all()
        alone = sum(dark(annotate(image, [it])) for it in seen)
        assert dark(drawn) == pytest.approx(alone, rel=0.02)


def dark(image):
    """How many pixels of label there are."""
    return (image.max(axis=2) < 90).sum()


def test_nothing_seen_leaves_the_picture_as_it_is():
    image = np.random.default_rng(0).integers(0, 256, (480, 640, 3)).astype(np.uint8)
    assert np.array_equal(annotate(image, View((), ())), image)
    assert annotate(image, ()) is not image


def test_what_is_no_picture_is_refused():
    with pytest.raises(InputError, match="BGR bytes"):
        annotate(np.zeros((4, 4)), ())
