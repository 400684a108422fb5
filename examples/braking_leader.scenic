# A car ahead brakes when the ego comes near, and drives on once it stands: see scenic.yaml beside this file.
param carla_map = 'Stage01'
param ego_speed = 9
param brake_within = 14
model scenic.simulators.carla.model

behavior DriveAndBrake(speed):
    try:
        do FollowLaneBehavior(target_speed=speed)
    interrupt when (distance from self to ego) < globalParameters.brake_within:
        take SetThrottleAction(0), SetBrakeAction(0.7)

lane = Uniform(*network.lanes)
leader = new Car on lane.centerline, with behavior DriveAndBrake(Range(5, 7))
ego = new Car following roadDirection from leader for Range(-35, -25),
    with behavior FollowLaneBehavior(target_speed=globalParameters.ego_speed)
require (distance from leader to intersection) > 15
