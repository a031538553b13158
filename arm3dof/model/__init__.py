"""Robots: reading a URDF, rigid-body dynamics, kinematics and the paper's closed forms."""
