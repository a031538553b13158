"""The studio: one live page on which a person sees, aims, moves, tunes and understands."""
