"""Make sure that the slow tests can draw with each backend of MuJoCo, not with the best alone."""

from bootstrap import RENDERERS, VENV, check_renderer

if __name__ == "__main__":
    for name in RENDERERS:
        check_renderer(str(VENV / "bin" / "python"), name)
