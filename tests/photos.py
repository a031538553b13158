"""Photographs that installed packages bring along, and boxes drawn on them by hand."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from arm3dof.vision.sources import read_image


def inside(package, *path):
    """Return the path of a package's file without importing the package."""
    return Path(find_spec(package).origin).parent.joinpath(*path)


COFFEE = inside("skimage", "data", "coffee.png")
FLOWER = inside("sklearn", "datasets", "images", "flower.jpg")


def photo(package, *path):
    """Read a photograph of a package."""
    return read_image(inside(package, *path))


def overlap(first, second):
    """Intersection over union of two boxes (u, v, width, height)."""
    corner = np.maximum(first[:2], second[:2])
    far = np.minimum(np.add(first[:2], first[2:]), np.add(second[:2], second[2:]))
    shared = np.prod(np.maximum(far - corner, 0))
    return shared / (np.prod(first[2:]) + np.prod(second[2:]) - shared)
