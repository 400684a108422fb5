"""What all messages share, and the one shape of an error."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

Document = dict[str, Any]
"""A JSON object whose own schema stands elsewhere, as that of a configuration."""

DatasetId = Annotated[
    str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.~-]*$", max_length=300)
]
"""Path below the root, slashes as ``~``."""
RunId = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=100)]
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=100)]
"""One folder, file, sensor or episode: no separators, no leading dot."""

Place = Annotated[
    str,
    StringConstraints(
        pattern=r"^(?:[A-Za-z0-9][A-Za-z0-9_.-]{0,99}|(?:s3a?|gs|gcs|az|azure)://[^\s?#@]{1,900})$"
    ),
]
"""Where a dataset is to be: a name in the first root, or an address of an object store."""
Label = Annotated[str, StringConstraints(min_length=1, max_length=100)]
"""A name for people."""


class Message(BaseModel):
    """The base of what goes over the wire: nothing unknown."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class FieldProblem(Message):
    """What is wrong with one value of a configuration.

    Attributes:
        path: keys and positions as the form has them; empty: the whole document.
    """

    path: list[str | int]
    message: str
    hint: str = ""


class ErrorMessage(Message):
    """Every answer that is no success.

    Attributes:
        code: a word for programs: ``bad_input``, ``not_found``, ``conflict``, ``refused``, ….
        message: what happened, in a sentence.
        hint: what to do.
        errors: by field, where fields are at fault.
    """

    code: str
    message: str
    hint: str = ""
    errors: list[FieldProblem] = Field(default_factory=list)
