"""What all tests share: reproducible examples, one thread a process."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

from hypothesis import settings

settings.register_profile("arm3dof", deadline=None, derandomize=True, print_blob=False)
settings.load_profile("arm3dof")
