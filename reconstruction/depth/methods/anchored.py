"""Depth map from an image and ranges: see `reconstruction.depth.kriging`."""

from dataclasses import dataclass, field

from ..kriging import AnchoredPrior, anchored_depth, fitted_prior
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..pixels import pixel_of


@dataclass(frozen=True)
class Anchored:
    """Depth from brightness and ranges."""

    prior: AnchoredPrior = field(default_factory=fitted_prior)
    title: str = "anchored on the spots"
    needs: tuple[Need, ...] = ("optics", "spots")

    def compile(self, context: Context) -> DepthSolver:
        setup = context.setup
        assert setup.optics is not None
        optics, shape = setup.optics, setup.plan.shape

        def solve(view: View) -> DepthEstimate | None:
            ranges = view.ranges
            if ranges is None:
                return None
            anchors = pixel_of(view.directions, optics, shape)
            depth_m, sigma_m = (each * view.directions[:, 2] for each in ranges.likeliest)
            return anchored_depth(view.image, anchors, depth_m, sigma_m, self.prior)

        return solve


METHOD = Anchored()
