"""Create ``.venv`` and install arm3dof into it, with the versions that CI tests.

    python3 tools/bootstrap.py [EXTRA ...]

Runs on a bare ``python3``: it uses the standard library alone, and its syntax stays old enough for
an old interpreter to reach the line that says which one is needed.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
OLDEST = (3, 11)
# most modules are never imported; those that are get compiled then, which is sooner in all
INSTALL = ("install", "--quiet", "--no-compile", "-c", str(ROOT / "constraints.txt"))
# shared libraries that wheels take for granted and a bare Debian lacks, and their packages
LIBRARIES = {
    "libatomic.so.1": "libatomic1",
    "libGL.so.1": "libgl1",
    "libgomp.so.1": "libgomp1",
}

# what MuJoCo draws with where there is no screen, by Mesa on the processor, and what it needs
RENDERERS = {
    "egl": "libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0",
    "osmesa": "libosmesa6",
}


def main(extras):
    """Create the environment when there is none, then install the package with ``extras``."""
    python = VENV / "bin" / "python"
    if not (VENV / "bin" / "pip").exists():
        check_version()
        check_venv()
        say(f"creating .venv with {sys.executable}")
        run(sys.executable, "-m", "venv", "--clear", VENV)
        # Python brings an old pip, which takes three times as long to choose versions
        subprocess.run([str(python), "-m", "pip", *INSTALL, "--upgrade", "pip"])
    wanted = f"[{','.join(extras)}]" if extras else ""
    say(f"installing arm3dof{wanted} into .venv (the first time takes a few minutes)")
    run(python, "-m", "pip", *INSTALL, "--editable", f"{ROOT}{wanted}")
    check_libraries(str(python), "-c", "import pinocchio, proxsuite, cv2")
    if "physics" in extras:
        check_renderer(str(python))


def check_version():
    """Stop with one line when this interpreter is too old."""
    if sys.version_info < OLDEST:
        have, need = dotted(sys.version_info[:2]), dotted(OLDEST)
        stop(
            f"arm3dof needs Python {need} or newer, and {sys.executable} is {have}; "
            f"name another one: make demo PYTHON=python{need}"
        )


def check_venv():
    """Make sure that ``python -m venv`` can work: Debian and Ubuntu ship it apart."""
    probe = [sys.executable, "-c", "import ensurepip, venv"]
    if subprocess.run(probe, stderr=subprocess.DEVNULL).returncode == 0:
        return
    package = f"python{dotted(sys.version_info[:2])}-venv"
    install(package, f"{sys.executable} cannot create environments")


def check_libraries(*command):
    """Run a command until it finds all shared libraries of the system that it needs."""
    for _ in LIBRARIES:
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        missing = re.search(r"(lib\S+): cannot open shared object file", done.stderr)
        if not missing:
            return
        library = missing.group(1)
        install(LIBRARIES.get(library, library), f"the library {library} is missing")


def check_renderer(python, name=None):
    """Make sure that the physics world can be drawn: by one of RENDERERS, or by any."""
    probe = [python, "-c", "from arm3dof.sim.renderer import backend; backend()"]
    chosen = {"MUJOCO_GL": name, "PYOPENGL_PLATFORM": ""} if name else {}
    for last in (False, True):
        done = subprocess.run(
            probe, stderr=subprocess.PIPE, text=True, cwd=ROOT, env={**os.environ, **chosen}
        )
        if done.returncode == 0:
            return
        if not last:
            why = f"{name} cannot draw" if name else "nothing draws"
            install(RENDERERS[name or "egl"], f"{why} the physics world")
    stop(done.stderr.strip().splitlines()[-1].rpartition("Error: ")[2])


def can_install():
    """Return whether this process may install packages of the system."""
    return os.geteuid() == 0 and shutil.which("apt-get") is not None


def install(packages, why):
    """Install packages of the system, named in one line, when that is allowed, else stop."""
    if not can_install():
        stop(f"{why}; install {packages} (Debian and Ubuntu: sudo apt-get install {packages})")
    say(f"{why}: installing {packages}")
    os.environ["DEBIAN_FRONTEND"] = "noninteractive"
    run("apt-get", "update", "-qq")
    run("apt-get", "install", "-y", "-qq", "--no-install-recommends", *packages.split())


def dotted(version):
    """Return (3, 11) as 3.11."""
    return ".".join(map(str, version))


def run(*command):
    """Run a command; its failure ends this script with the same code."""
    code = subprocess.run([str(part) for part in command]).returncode
    if code:
        sys.exit(code)


def say(text):
    """Tell the reader what is going on."""
    print(f"== {text}", flush=True)


def stop(text):
    """End with one line on stderr."""
    sys.exit(f"error: {text}")


if __name__ == "__main__":
    main(sys.argv[1:])
