"""Maps: the OpenDRIVE town writer, the bake to arrays, meshes, navigation mesh, spawn points.

``load_town(name)`` is the way in; what comes out is a frozen ``Town``.
"""
