"""The eye: from a picture to points in the base frame."""
