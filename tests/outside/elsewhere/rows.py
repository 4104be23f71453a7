"""Ranges of the spots as rows of a text."""

from reconstruction.exports import Export


def write(shots, path):
    rows = [[shot.stamp_s, *shot.ranges.range_m] for shot in shots if shot.ranges is not None]
    path.write_text("".join(",".join(map(str, row)) + "\n" for row in rows))


EXPORT = Export("ranges as rows", write, ".csv")
