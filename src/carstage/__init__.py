"""Car-STAGE: labelled, verified, multi-sensor driving datasets from the CARLA simulator.

Nothing is imported eagerly here: the collector, which may run under the old Python of an old
``carla`` wheel, imports this package too.
"""

__version__ = "0.1.0"
