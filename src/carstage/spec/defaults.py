"""Values that a configuration may leave out, each here once; the configuration takes its from here.

A raw log or dataset of an earlier version may lack a field that came later: these stand for it.
"""

MAX_DISTANCE_M = 80.0
MIN_LIDAR_POINTS = 5
MIN_VISIBLE_PX = 10
RADIUS_M = 80.0
WARMUP_TICKS = 20
