"""The arm's own world in a process of its own, in real time; a page only looks and asks."""
