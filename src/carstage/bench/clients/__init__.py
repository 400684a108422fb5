"""Clients that are measured, each a process of its own: the only modules here that use ``carla``.

They take the collector's plan and print events as it does, so that one reader follows both.
"""
