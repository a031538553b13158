"""Make sure that the browser tests have a Chromium: take one that is there, else install one."""

from __future__ import annotations

import shutil
import subprocess
import sys

from bootstrap import can_install, check_libraries, install, say, stop
from playwright.sync_api import sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def main() -> None:
    """Find or install a browser; stop with a line about the cure when there is none."""
    playwright = (sys.executable, "-m", "playwright")
    check_libraries(*playwright, "--version")
    if find() is None and can_install():
        install("chromium", "the browser tests need a browser")
    if find() is None:
        say("installing Playwright's chromium for the browser tests")
        subprocess.run([*playwright, "install", "chromium"], check=False)
    if (browser := find()) is None:
        stop("no Chromium could be found or installed; make test needs none")
    say(f"browser: {browser}")


def find() -> str | None:
    """Return the path of an installed Chromium: on the PATH, or Playwright's own."""
    for name in NAMES:
        if path := shutil.which(name):
            return path
    with sync_playwright() as playwright:
        return shutil.which(playwright.chromium.executable_path)


if __name__ == "__main__":
    main()
