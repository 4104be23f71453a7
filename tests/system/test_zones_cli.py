"""Zone sensors from the command line: budget, simulation, reconstruction, page and export."""

import json
from pathlib import Path

import numpy as np
import pytest

from commands import run, spisim
