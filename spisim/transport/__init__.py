"""Light transport: the fraction of emitted power that each virtual pixel and each spot returns."""

from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import TransportWarning
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.picture import CAMERA_OFFSET_M, camera_view, fine_view
from spisim.transport.raycaster import RayCaster
from spisim.transport.truth import GroundTruth, ground_truth, ground_truths

__all__ = [
    "CAMERA_OFFSET_M",
    "GroundTruth",
    "Outputs",
    "PathLengthBins",
    "RayCaster",
    "TransportWarning",
    "camera_view",
    "fine_view",
    "ground_truth",
    "ground_truths",
]
