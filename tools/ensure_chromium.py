"""Make sure that the browser tests have a Chromium: take one that is there, else install one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def main() -> int:
    """Return 0 when a browser is there at the end, 1 with a line about the cure when not."""
    if found := find():
        print(f"== browser: {found}")
        return 0
    if os.geteuid() == 0 and shutil.which("apt-get"):
        print("== installing Debian's chromium for the browser tests", flush=True)
        environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
        subprocess.run(["apt-get", "update", "-qq"], check=False)
        install = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", "chromium"]
        subprocess.run(install, env=environment, check=False)
        if find():
            return 0
    print("== installing Playwright's chromium for the browser tests", flush=True)
    subprocess.run([sys.executable, "-m", "playwright", "install", "chromium"], check=False)
    if find():
        return 0
    print("error: no Chromium could be found or installed; run make test-fast", file=sys.stderr)
    return 1


def find() -> str | None:
    """Return the path of an installed Chromium: on the PATH, or Playwright's own."""
    from playwright.sync_api import sync_playwright

    for name in NAMES:
        if path := shutil.which(name):
            return path
    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    return path if shutil.which(path) else None


if __name__ == "__main__":
    sys.exit(main())
