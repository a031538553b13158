"""What a URDF says about looks: shapes and materials that could not be drawn are problems."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np

from arm3dof.model.urdf_numbers import NumberReader

_SIZES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}


def check_shapes(link: Element, where: str, reader: NumberReader) -> None:
    """Note what is wrong with the visual and collision elements of a link."""
    for shape in (*link.findall("visual"), *link.findall("collision")):
        place = f"{where} {shape.tag}"
        reader.origin(shape, place)
        _check_geometry(shape.find("geometry"), place, reader)
        for material in shape.findall("material"):
            _check_material(material, place, reader)


def check_materials(materials: Iterable[Element], reader: NumberReader) -> None:
    """Note what is wrong with the robot's own materials."""
    seen: set[str] = set()
    for material in materials:
        name = material.get("name", "")
        where = f"material '{name}'"
        _check_material(material, where, reader)
        if name in seen:
            reader.note(where, "is defined twice", "keep one")
        seen.add(name)
        if material.find("color") is None and material.find("texture") is None:
            reader.note(where, "has neither color nor texture", 'add <color rgba="0.5 0.5 0.5 1"/>')


def _check_geometry(geometry: Element | None, where: str, reader: NumberReader) -> None:
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1 or shapes[0].tag not in _SIZES:
        found = ", ".join(shape.tag for shape in shapes) or "nothing"
        cure = f"give one of: {', '.join(_SIZES)}"
        reader.note(where, f"<geometry> holds {found}", cure)
        return
    shape = shapes[0]
    for key, count in _SIZES[shape.tag].items():
        if key not in shape.attrib:
            reader.note(where, f"<{shape.tag}> has no {key}", f'write <{shape.tag} {key}="..."/>')
        elif (reader.vector(shape, key, where, [0.0] * count) <= 0.0).any():
            what = f'<{shape.tag}> {key} "{shape.get(key)}" is not positive'
            reader.note(where, what, "give sizes in metres")
    if shape.tag == "mesh":
        reader.vector(shape, "scale", where, (1.0, 1.0, 1.0))
        if not shape.get("filename"):
            reader.note(where, "<mesh> has no filename", 'write <mesh filename="..."/>')


def _check_material(material: Element, where: str, reader: NumberReader) -> None:
    if not material.get("name"):
        reader.note(where, "<material> has no name", 'write <material name="...">')
    for color in material.findall("color"):
        if "rgba" not in color.attrib:
            reader.note(where, "<color> has no rgba", 'write <color rgba="0.5 0.5 0.5 1"/>')
            continue
        rgba = reader.vector(color, "rgba", where, np.ones(4).tolist())
        if ((rgba < 0.0) | (rgba > 1.0)).any():
            what = f'<color> rgba "{color.get("rgba")}" is outside 0 to 1'
            reader.note(where, what, "scale it to that range")
    for texture in material.findall("texture"):
        if not texture.get("filename"):
            reader.note(where, "<texture> has no filename", 'write <texture filename="..."/>')
