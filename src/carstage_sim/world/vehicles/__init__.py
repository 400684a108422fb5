"""Vehicles: parameters, drive train, tyres, the table of their state and the step of it."""
