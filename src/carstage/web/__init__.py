"""The graphical interface's server: REST and one WebSocket over configurations, runs and datasets.

``carstage.web.app.create_app`` is the way in; ``messages`` is what goes over the wire, ``static``
the built page. Nothing heavy is imported before a request needs it.
"""
