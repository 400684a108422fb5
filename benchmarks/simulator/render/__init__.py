"""Do pictures and point clouds come in time, and do they look right?

``scene`` sets up the reference scene, ``speed`` and ``compiling`` measure, ``looks`` judges
pictures, ``gallery`` paints those of the documentation, ``gallery_page`` writes a page of all that
there is to see.
"""

from benchmarks.simulator.render.trial import check_render

__all__ = ["check_render"]
