"""Letters for the pictures of `reconstruction`, which draws them without a plotting library.

    python tools/glyphs.py

Draws DejaVu Sans, which comes with Matplotlib, in 16 levels of grey, and writes
reconstruction/outputs/letters.py.
"""

import base64
import zlib
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

SIZE = 14
LETTERS = "".join(map(chr, range(32, 127))) + "×°²³¹⁰⁴⁵⁶⁷⁸⁹⁻±µλσ–—’…"
TARGET = Path(__file__).parents[1] / "reconstruction" / "outputs" / "letters.py"


def main() -> None:
    """Draw and write."""
    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    font = ImageFont.truetype(file, SIZE)
    ascent, descent = font.getmetrics()
    widths = [round(font.getlength(letter)) for letter in LETTERS]
    strip = np.hstack(
        [glyph(font, *each, ascent + descent) for each in zip(LETTERS, widths, strict=True)]
    )
    levels = np.round(strip / 17).astype(np.uint8)  # 0..15
    if levels.shape[1] % 2:
        levels = np.pad(levels, ((0, 0), (0, 1)))
    packed = zlib.compress((levels[:, ::2] << 4 | levels[:, 1::2]).tobytes(), 9)
    text = TEXT.format(
        others=LETTERS[95:],
        height=ascent + descent,
        widths=in_lines("".join(f"{width:x}" for width in widths)),
        packed=in_lines(base64.b85encode(packed).decode()),
    )
    TARGET.write_text(text, encoding="utf-8")


def in_lines(text: str) -> str:
    """A long string as Python has it on several lines."""
    parts = [text[start : start + 92] for start in range(0, len(text), 92)]
    return "\n".join(f'    "{part}"' for part in parts)


def glyph(font: ImageFont.FreeTypeFont, letter: str, width: int, height: int) -> np.ndarray:
    """Grey levels of a letter, black on nothing: (height, width)."""
    image = Image.new("L", (width, height))
    ImageDraw.Draw(image).text((0, 0), letter, fill=255, font=font)
    return np.asarray(image)


TEXT = '''"""Letters of DejaVu Sans as grey levels; made by tools/glyphs.py.

DejaVu changes to Bitstream Vera are in the public domain; Bitstream Vera is a trademark of
Bitstream, Inc., copyright (c) 2003 by Bitstream, Inc., free to use, embed and redistribute.
"""

HEIGHT = {height}
"""Of a line, in pixels."""
LETTERS = "".join(map(chr, range(32, 127))) + "{others}"
WIDTHS = (
{widths}
)
"""Of each letter in pixels, a hexadecimal digit."""
PACKED = (
{packed}
)
"""All letters side by side, two pixels in a byte, compressed."""
'''

if __name__ == "__main__":
    main()
