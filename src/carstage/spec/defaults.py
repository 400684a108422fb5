"""Defaults that several modules need, each here once; the configuration takes its from here.

Those of a whole section (labels, ground truth, road users) stand at its dataclass.
"""

MAX_DISTANCE_M = 80.0
#: Of a configuration. A specification without the field is older than the rule: it asks for none.
MIN_LIDAR_POINTS = 5
RAW_QUEUE_MB = 256
#: What may wait for the disk where a plan does not say; runs say it, from the configuration.
QUEUE_BYTES = 256 * 1024 * 1024
RAW_STORE = "chunklog"
