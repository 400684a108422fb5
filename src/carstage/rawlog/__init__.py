"""The raw log: what the collector records and everything downstream reads.

`format` holds the bytes, `writing` and `payloads` write them (standard library, Python 3.8);
`reader` is numpy. Nothing is imported here, so that a collector under an old Python meets only what
it can run.
"""
