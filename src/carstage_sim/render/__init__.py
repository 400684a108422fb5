"""Ray casting: scene store, two-level BVH, kernels (numba), shading, sky and weather.

One geometry truth for cameras, LiDAR and shadows; no rasteriser.
"""
