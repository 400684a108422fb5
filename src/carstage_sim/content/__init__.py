"""Parametric shapes: vehicles, pedestrians, buildings, trees, street furniture as triangle meshes.

Pure functions of parameters and a seed; how materials look is the renderer's.
"""
