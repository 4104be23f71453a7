"""Film of flights through one world, seen from above."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from reactive_flight import FRAMES_PER_S, Flown

from reconstruction.base.arrays import Floats
from spisim.scene import Scene

EVERY_S, PLAYED = 0.25, 2.0
"""Time between two pictures, and how much faster than true they are played."""
COLOURS = ("C3", "C0", "C2", "0.4")


def write_film(file: Path, scene: Scene, flights: Sequence[Flown]) -> None:
    """Write an animation (GIF): surfaces at the drone's height, ways, and collisions."""
    import matplotlib.pyplot as plt
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.collections import LineCollection

    height_m = float(flights[0].path_m[0, 2])
    figure, axes = plt.subplots(
        1, len(flights), figsize=(3.2 * len(flights), 4.0), sharey=True, layout="constrained"
    )
    everything = np.concatenate([flight.path_m[:, :2] for flight in flights])
    low, high = everything.min(axis=0) - 2, everything.max(axis=0) + 2
    walls = section(scene, height_m)
    lines, drones = [], []
    for axis, flight, colour in zip(axes, flights, COLOURS, strict=True):
        axis.add_collection(LineCollection(walls, colors="k", linewidths=0.8))
        lines.append(axis.plot([], [], color=colour, linewidth=1.2)[0])
        drones.append(axis.plot([], [], "o", color=colour)[0])
        axis.plot(*flight.hits_m[:, :2].T, "x", color="r", alpha=0.3)
        per_100_m = 100 * flight.hits / flight.way_m
        axis.set(
            title=f"{flight.sense}\n{flight.way_m:.0f} m, {flight.hits} collisions "
            f"({per_100_m:.1f} per 100 m)",
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="m",
        )  # fmt: skip
        axis.title.set_fontsize(9)

    def draw(picture: int) -> list[object]:
        stop = round(picture * EVERY_S * FRAMES_PER_S) + 1
        for line, drone, flight in zip(lines, drones, flights, strict=True):
            some = flight.path_m[:stop]
            line.set_data(some[:, 0], some[:, 1])
            drone.set_data(some[-1:, 0], some[-1:, 1])
        return [*lines, *drones]

    pictures = int(max(flight.seconds for flight in flights) / EVERY_S) + 1
    film = FuncAnimation(figure, draw, frames=pictures)
    film.save(file, PillowWriter(fps=PLAYED / EVERY_S), dpi=70)
    plt.close(figure)


def section(scene: Scene, height_m: float) -> Floats:
    """Segments (n, 2, 2) of all still surfaces at a height."""
    parts = []
    for thing in scene.objects:
        lines = trimesh.intersections.mesh_plane(thing.mesh, [0, 0, 1], [0, 0, height_m])
        parts.append(np.asarray(lines)[..., :2])
    return np.concatenate(parts)
