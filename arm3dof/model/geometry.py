"""The shapes of a URDF's links: what is seen and what collides, as plain records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

from arm3dof.model.robot import Description

Rgba = tuple[float, float, float, float]
Kind = Literal["box", "cylinder", "sphere", "mesh"]


@dataclass(frozen=True, eq=False)
class LinkShape:
    """One shape that is fixed to a link.

    Attributes:
        link: the link's name.
        name: the shape's own name; may be empty.
        kind: what it is.
        size: edges of a box; radius and length of a cylinder; radius of a sphere; scale of a
            mesh along its axes [m, or 1 for a mesh].
        placement: its pose in the link's frame.
        colour: red, green, blue and opacity, 0 to 1; None where the URDF says nothing.
        file: the mesh's file; None for another shape and for a mesh that cannot be found.
    """

    link: str
    name: str
    kind: Kind
    size: tuple[float, ...]
    placement: pin.SE3
    colour: Rgba | None
    file: Path | None = None


def link_shapes(
    description: Description, role: Literal["visual", "collision"]
) -> tuple[LinkShape, ...]:
    """Return the shapes of a valid robot's links, in document order.

    Args:
        description: URDF text and the folders of its meshes.
        role: what is seen, or what collides.
    """
    root = ET.fromstring(description.urdf)
    colours = {
        material.get("name", ""): colour
        for material in root.iter("material")
        if (colour := _own_colour(material)) is not None
    }
    return tuple(
        _shape(link.get("name", ""), element, colours, description.package_dirs)
        for link in root.findall("link")
        for element in link.findall(role)
    )


def _shape(
    link: str, element: ET.Element, colours: Mapping[str, Rgba], folders: Sequence[Path]
) -> LinkShape:
    material = element.find("material")
    colour = None
    if material is not None:
        colour = _own_colour(material) or colours.get(material.get("name", ""))
    shape = element.find("geometry/*")
    if shape is None:
        raise ValueError(f"link '{link}' has a shape without geometry")  # reading forbids it
    common = (_placement(element.find("origin")), colour)
    name = element.get("name", "")
    if shape.tag == "box":
        return LinkShape(link, name, "box", _numbers(shape.get("size", "")), *common)
    if shape.tag == "mesh":
        scale = _numbers(shape.get("scale", "1 1 1"))
        file = find_mesh(shape.get("filename", ""), folders)
        return LinkShape(link, name, "mesh", scale, *common, file)
    radius = float(shape.get("radius", "0"))
    if shape.tag == "sphere":
        return LinkShape(link, name, "sphere", (radius,), *common)
    return LinkShape(link, name, "cylinder", (radius, float(shape.get("length", "0"))), *common)


def find_mesh(name: str, folders: Sequence[Path]) -> Path | None:
    """Return the file that a mesh's name means, or ``None`` when there is no such file.

    Args:
        name: as the URDF writes it; ``package://`` and relative names start in ``folders``.
        folders: where packages lie.
    """
    name = name.removeprefix("file://")
    bare = name.removeprefix("package://")
    candidates = [Path(name)] if bare == name else []
    candidates += [Path(folder) / bare for folder in folders]
    return next((path for path in candidates if path.is_file()), None)


def _own_colour(material: ET.Element) -> Rgba | None:
    element = material.find("color")
    if element is None:
        return None
    red, green, blue, alpha = _numbers(element.get("rgba", ""))
    return red, green, blue, alpha


def _placement(origin: ET.Element | None) -> pin.SE3:
    if origin is None:
        return pin.SE3.Identity()
    rpy = np.array(_numbers(origin.get("rpy", "0 0 0")))
    xyz = np.array(_numbers(origin.get("xyz", "0 0 0")))
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(word) for word in text.split())
