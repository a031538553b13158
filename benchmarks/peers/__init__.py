"""The peers that arm3dof is measured against, in a Python environment of their own.

The modules here, except ``process``, run in ``.venv-peers`` and know nothing of arm3dof: a problem
reaches them as plain arrays (``problem``), and each peer formulates and solves it in its own way.
"""
