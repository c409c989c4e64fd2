"""Compiled twins of the hot loops: the only place that imports numba.

A module ``x.py`` holds the readable reference in NumPy, ``x_compiled.py`` its twin; tests hold them to the same
numbers. Compiled modules are imported by :mod:`psstereo.kernels.dispatch` only, when there is enough to do.
"""
