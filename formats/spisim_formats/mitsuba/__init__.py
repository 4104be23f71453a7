"""Scene files of Mitsuba 3, parsed by Mitsuba without instantiating anything."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat("Mitsuba", {".xml": lazily("spisim_formats.mitsuba.reading:read_mitsuba")})
