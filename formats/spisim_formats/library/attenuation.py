"""How light of a lamp falls off with distance where a file tells it, and here."""

from spisim_formats.library.xml import numbers


def at_a_metre(constant: float, linear: float, quadratic: float) -> tuple[float, str]:
    """What 1 / (c + l d + q d²) makes of an intensity, and what to tell where it cannot be kept.

    Here all light falls with the square of the distance d. That is the same for q alone; else the
    intensity is kept, so that both agree at one unit where the three add up to 1.
    """
    if constant == linear == 0 and quadratic > 0:
        return 1 / quadratic, ""
    if (constant, linear, quadratic) == (0, 0, 0):
        return 1.0, ""
    terms = [
        f"{value:.4g}{power}"
        for value, power in ((constant, ""), (linear, " d"), (quadratic, " d²"))
        if value
    ]
    whole = " + ".join(terms)
    return 1.0, f"; it falls off with the distance d as 1 / ({whole}) there, as 1 / d² here"


def number_or(text: str | None, default: float, what: str) -> float:
    """A finite number in a text, or the default for none; InputError for another text."""
    return numbers(text, 1, what)[0] if text is not None and text.strip() else default
