"""The check of the client's whole API: each name of ``dir(carla)`` is called, its effect seen.

One module per class of the client registers trials; ``run`` plays them against a server; ``page``
writes the table of the documentation from the same entries.
"""

from client_api.page import api_page
from client_api.run import Outcome, check_api

__all__ = ["Outcome", "api_page", "check_api"]
