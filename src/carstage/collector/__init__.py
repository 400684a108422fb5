"""The collector: the only code of the framework that talks to ``carla``, in a separate process.

The modules are the paper's ``paths``, ``client``, ``world``, ``weather``, ``scenario``, ``ego``,
``actors``, ``maps``, ``sensors``, ``timing`` and ``processing``; the twelfth is
``carstage.conversion``. What they rest on is in ``internals``. ``sensor_preview`` draws live views.

It takes one JSON plan, records raw truth into logs and prints events as JSON lines. Everything here
needs the standard library, ``carla`` and ``carstage.rawlog.writing`` alone and runs on Python 3.8:
older ``carla`` wheels exist for no later Python.
"""
