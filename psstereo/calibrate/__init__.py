"""Lights and cameras found from targets, from the object itself, or from the clock.

What takes several modules has a folder, which gives its public names; folders know nothing of one another.
"""
