"""The user's home folder, which a user id of a container may lack."""

import os
from pathlib import Path


def home() -> Path:
    """Return the home folder; without one, a path in which nothing exists or can be made."""
    try:
        return Path.home()
    except RuntimeError:  # neither HOME nor an entry of the password database
        return Path(os.devnull) / "home"
