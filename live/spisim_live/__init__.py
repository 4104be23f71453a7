"""Live streams: frames from a rig or a file, and results as they come (docs/live.md)."""

import logging

from .counts import Counts
from .framing import Kind, Message, Parser, pack
from .loop import Loop
from .poses import Pose, command, pose_of
from .reception import Arrival, Reception
from .results import Outcome, State
from .sending import CaptureSource, Sender
from .setups import StreamSetup, frame_payload, frame_period_s, setup_payload
from .tables import packed, unpacked

logging.getLogger(__name__).addHandler(logging.NullHandler())

__all__ = [
    "Arrival",
    "CaptureSource",
    "Counts",
    "Kind",
    "Loop",
    "Message",
    "Outcome",
    "Parser",
    "Pose",
    "Reception",
    "Sender",
    "State",
    "StreamSetup",
    "command",
    "frame_payload",
    "frame_period_s",
    "pack",
    "packed",
    "pose_of",
    "setup_payload",
    "unpacked",
]
