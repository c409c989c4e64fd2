"""Lights and cameras found from targets, from the object itself, or from the clock: one method a module."""
