"""Runs: the loop that joins controller and plant, its recording and its figures of merit."""
