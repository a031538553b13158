"""The shapes of a URDF's links, as plain records."""

from pathlib import Path

import numpy as np

from arm3dof.model.geometry import find_mesh, link_shapes
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Description

TEXT = """<robot name="r">
  <material name="red"><color rgba="1 0 0 0.5"/></material>
  <link name="a">
    <visual name="plate"><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>
      <geometry><box size="0.1 0.2 0.3"/></geometry><material name="red"/></visual>
    <visual><geometry><sphere radius="0.4"/></geometry>
      <material name="own"><color rgba="0 1 0 1"/></material></visual>
    <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
  </link>
  <link name="b">
    <visual><geometry><mesh filename="package://p/m.stl" scale="1 2 3"/></geometry></visual>
  </link>
</robot>"""


def test_shapes_come_in_order_with_size_place_and_colour(tmp_path):
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "m.stl").touch()
    plate, ball, mesh = link_shapes(Description("r", TEXT, (tmp_path,)), "visual")
    assert (plate.link, plate.name, plate.kind, plate.size) == (
        "a",
        "plate",
        "box",
        (0.1, 0.2, 0.3),
    )
    assert plate.colour == (1.0, 0.0, 0.0, 0.5)
    np.testing.assert_allclose(plate.placement.act(np.array([1.0, 0, 0])), [1, 3, 3], atol=1e-12)
    assert (ball.kind, ball.size, ball.colour) == ("sphere", (0.4,), (0.0, 1.0, 0.0, 1.0))
    assert (mesh.link, mesh.kind, mesh.size, mesh.colour) == ("b", "mesh", (1.0, 2.0, 3.0), None)
    assert mesh.file == tmp_path / "p" / "m.stl"


def test_what_collides_is_asked_for_by_itself():
    (post,) = link_shapes(Description("r", TEXT), "collision")
    assert (post.kind, post.size, post.file) == ("cylinder", (0.1, 0.5), None)


def test_meshes_are_found_as_urdfs_name_them(tmp_path):
    file = tmp_path / "m.stl"
    file.touch()
    assert find_mesh(f"file://{file}", ()) == file
    assert find_mesh(str(file), ()) == file
    assert find_mesh("m.stl", [Path("/nowhere"), tmp_path]) == file
    assert find_mesh("package://p/m.stl", [tmp_path]) is None


def test_library_robots_have_meshes_that_exist():
    shapes = link_shapes(load_robot("so101").description, "visual")
    assert len(shapes) > 10
    assert all(shape.file is not None for shape in shapes)
