"""Traffic lights and signs: phases, detectors, turns at junctions without lights."""
