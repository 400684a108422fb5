# A car brakes to a stand when the ego comes near, and the ego stops behind it: see scenic.yaml beside this file.
param carla_map = 'Stage01'
param ego_speed = 9
param brake_within = 20
model scenic.simulators.carla.model

behavior DriveAndBrake(speed):
    try:
        do FollowLaneBehavior(target_speed=speed)
    interrupt when (distance from self to ego) < globalParameters.brake_within:
        take SetThrottleAction(0), SetBrakeAction(0.7)

behavior FollowAndStop(speed, car):
    try:
        do FollowLaneBehavior(target_speed=speed)
    interrupt when (distance from self to car) < 14:
        take SetThrottleAction(0), SetBrakeAction(1)

lane = Uniform(*network.lanes)
leader = new Car on lane.centerline, with behavior DriveAndBrake(Range(5, 7))
ego = new Car following roadDirection from leader for Range(-34, -28),
    with behavior FollowAndStop(globalParameters.ego_speed, leader)
require (distance from leader to intersection) > 15
