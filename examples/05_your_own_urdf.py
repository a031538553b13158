"""Bring your own robot: any fixed-base URDF, of any number of joints."""

import tempfile
from pathlib import Path

import numpy as np

import arm3dof

PENDULUM = """
<robot name="two_links">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0.15 0 0"/> <mass value="0.5"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="4e-3" iyz="0" izz="4e-3"/>
    </inertial>
  </link>
  <link name="fore">
    <inertial>
      <origin xyz="0.10 0 0"/> <mass value="0.3"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/>
    </inertial>
  </link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/> <child link="upper"/> <axis xyz="0 -1 0"/>
    <limit lower="-2" upper="2" effort="8" velocity="6"/>
    <dynamics damping="0.02" friction="0.05"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/> <child link="fore"/> <origin xyz="0.3 0 0"/> <axis xyz="0 -1 0"/>
    <limit lower="-2.5" upper="2.5" effort="4" velocity="6"/>
    <dynamics damping="0.02" friction="0.02"/>
  </joint>
  <joint name="hand" type="fixed">
    <parent link="fore"/> <child link="tool"/> <origin xyz="0.25 0 0"/>
  </joint>
</robot>
"""

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "two_links.urdf"
    path.write_text(PENDULUM)
    robot = arm3dof.load_robot(path)
    print(robot)

    # A description that is wrong says where, what and how to mend it.
    path.write_text(PENDULUM.replace('mass value="0.5"', 'mass value="-0.5"'))
    try:
        arm3dof.load_robot(path)
    except arm3dof.RobotError as error:
        for problem in error.problems:
            print("problem:", problem)

reach = arm3dof.inverse_kinematics(robot, [0.35, 0.0, 0.25])
print(reach.sentence)

controller = arm3dof.MpcController(robot)
plant = arm3dof.PinocchioPlant(robot)
plant.reset(arm3dof.JointState(0.0, np.zeros(2), np.zeros(2)))
recording = arm3dof.run_loop(plant, controller, reach.solutions[0], duration=4.0)
print("settled:", arm3dof.summarise(recording).settled)
