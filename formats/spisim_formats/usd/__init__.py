"""OpenUSD, as text, binary and package, read with Pixar's library."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat(
    "OpenUSD",
    dict.fromkeys(
        (".usd", ".usda", ".usdc", ".usdz"), lazily("spisim_formats.usd.reading:read_usd")
    ),
)
