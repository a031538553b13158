"""Measurements of arm3dof on this machine; they print tables and never fail a build."""
