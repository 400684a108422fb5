"""The collector: the only code of the framework that talks to ``carla``, in a process of its own.

It takes one JSON plan, records raw truth into logs and prints events as JSON lines. Everything here
needs the standard library, ``carla`` and ``carstage.rawlog.writing`` alone and runs on Python 3.8:
older ``carla`` wheels exist for no later Python.
"""
