"""URDFs that tests of the model share: one small good robot that has a bit of everything."""

GOOD = """<?xml version="1.0"?>
<robot name="small" version="1.0">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base">
    <visual>
      <origin xyz="0 0 0.1" rpy="0 0 0"/>
      <geometry><cylinder radius="0.05" length="0.2"/></geometry>
      <material name="grey"/>
    </visual>
  </link>
  <link name="upper">
    <inertial>
      <origin xyz="0.1 0.01 0.02" rpy="0.1 0.2 0.3"/>
      <mass value="0.5"/>
      <inertia ixx="0.001" ixy="0.0001" ixz="-0.0001" iyy="0.002" iyz="0.0002" izz="0.0025"/>
    </inertial>
    <visual><geometry><box size="0.2 0.04 0.04"/></geometry></visual>
    <collision><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
  <link name="bracket">
    <inertial>
      <mass value="0"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
    </inertial>
  </link>
  <link name="fore">
    <inertial>
      <origin xyz="0.08 0 0"/>
      <mass value="0.3"/>
      <inertia ixx="0.0004" ixy="0" ixz="0" iyy="0.0008" iyz="0" izz="0.0009"/>
    </inertial>
  </link>
  <link name="slider">
    <inertial>
      <mass value="0.1"/>
      <inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.0001" iyz="0" izz="0.0001"/>
    </inertial>
  </link>
  <link name="left"><inertial>
    <origin xyz="0 0.01 0"/><mass value="0.02"/>
    <inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/>
  </inertial></link>
  <link name="right"><inertial>
    <origin xyz="0 -0.01 0"/><mass value="0.02"/>
    <inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/>
  </inertial></link>
  <link name="grip_tcp"/>
  <joint name="pan" type="continuous">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.2" rpy="0.1 0 0"/><axis xyz="0 0 1"/>
    <limit effort="3" velocity="4"/><dynamics damping="0.2" friction="0.1"/>
  </joint>
  <joint name="plate" type="fixed">
    <parent link="upper"/><child link="bracket"/><origin xyz="0.1 0 0" rpy="0 0 0.5"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="bracket"/><child link="fore"/>
    <origin xyz="0.1 0 0" rpy="0 0.2 0"/><axis xyz="0 2 1"/>
    <limit lower="-1.5" upper="2" effort="2" velocity="5"/>
    <dynamics friction="0.05"/>
    <safety_controller k_velocity="10"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="fore"/><child link="slider"/>
    <origin xyz="0.1 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0.01" upper="0.1" effort="10" velocity="0.5"/>
    <dynamics damping="1"/>
  </joint>
  <joint name="finger" type="prismatic">
    <parent link="slider"/><child link="left"/><origin xyz="0.02 0.01 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.02" effort="5" velocity="0.1"/>
  </joint>
  <joint name="follower" type="prismatic">
    <parent link="slider"/><child link="right"/><origin xyz="0.02 -0.01 0"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.02" effort="5" velocity="0.1"/>
    <mimic joint="finger" multiplier="1"/>
  </joint>
  <joint name="tip" type="fixed">
    <parent link="slider"/><child link="grip_tcp"/><origin xyz="0.05 0 0"/>
  </joint>
  <gazebo><plugin name="ignored"/></gazebo>
</robot>
"""

FINGERS = {"finger": 0.015, "follower": 0.0}
"""What is locked, and where, to make ``GOOD`` an arm of three joints."""
