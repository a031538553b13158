"""What all tests share: reproducible examples, one thread a process."""

import os
import signal

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

from hypothesis import settings

settings.register_profile("arm3dof", deadline=None, derandomize=True, print_blob=False)
settings.load_profile("arm3dof")

# A shell's background job ignores Ctrl-C, and so would the programs that the tests start and stop.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
