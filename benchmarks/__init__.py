"""Measurements of arm3dof on this machine; they print tables and never fail a build."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: all run on one thread
