"""Options in groups: data classes that stand for options of a command."""

from dataclasses import FrozenInstanceError, dataclass
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from reconstruction.base.errors import InputError
from spisim_app.cli import options as opt
from spisim_app.cli.inputs import PlanOptions, instrument_with
from spisim_app.cli.weather_options import Weather, WeatherOfDrops
from spisim_serving.cli.flights import FlightOptions
from spisim_serving.cli.line import LinkOptions


@dataclass(frozen=True)
class Tools:
    """What a test needs."""

    saw: Annotated[int, typer.Option(help="Teeth.")] = 3
    drill: Annotated[bool, typer.Option("--drill")] = False

    def __post_init__(self) -> None:
        if self.saw > 9:
            raise InputError("--saw is at most 9")


USUAL = Tools()
app = typer.Typer()


@app.command()
@opt.with_options
def use(
    wood: str,
    tools: Tools = USUAL,
    weather: Weather = Weather(),  # noqa: B008 - as Typer has it
    glue: Annotated[str, typer.Option()] = "none",
) -> None:
    """Work."""
    print(wood, tools, weather.fog, glue)


def test_fields_are_options_where_their_group_stands() -> None:
    run = CliRunner().invoke(app, ["oak", "--drill", "--fog", "radiation", "--glue", "bone"])
    assert run.output == "oak Tools(saw=3, drill=True) radiation bone\n"
    text = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).output
    assert text.index("--saw") < text.index("--drill") < text.index("--fog") < text.index("--glue")
    assert "--tools" not in text


def test_a_group_checks_itself() -> None:
    assert str(CliRunner().invoke(app, ["oak", "--saw", "12"]).exception) == "--saw is at most 9"
    assert CliRunner().invoke(app, ["oak", "--saw", "x"]).exit_code == 2


def test_light_is_a_number_of_paths_or_an_error() -> None:
    assert opt.LightBudget().arguments == {"spp": opt.SPP}
    assert opt.LightBudget(spp=4).arguments == {"spp": 4}
    assert opt.LightBudget(transport_noise_share=0.3).arguments == {"transport_noise_share": 0.3}
    surrogate = opt.LightOptions(spp=4, light="surrogate").arguments
    assert surrogate == {"spp": 4, "light": "surrogate"}
    for kind in (opt.LightBudget, opt.LightOptions):
        with pytest.raises(InputError, match="--spp and --transport-noise-share exclude each"):
            kind(spp=4, transport_noise_share=0.3)
    with pytest.raises(FrozenInstanceError):
        opt.TRACED.spp = 5  # type: ignore[misc]


def test_a_plan_replaces_what_it_gives() -> None:
    own = instrument_with("paper")
    assert instrument_with("paper", plan=PlanOptions()).text == own.text
    changed = instrument_with("paper", plan=PlanOptions(patterns=32, polarity="single-ended"))
    assert changed.imaging.plan.patterns == 32
    assert changed.imaging.plan.order == own.imaging.plan.order
    with pytest.raises(InputError, match="single-endd"):
        instrument_with("paper", plan=PlanOptions(polarity="single-endd"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speed": 2.0}, "--speed goes with --path"),
        ({"frame": "optical"}, "--frame goes with --path"),
        ({"path": "p.csv", "pose": "0,0,1"}, "--path and --pose exclude each other"),
        ({"path": "p.csv", "gust": ["0,1,0,0,0"]}, "--path and --gust exclude each other"),
    ],
)
def test_options_of_a_flight_that_contradict_each_other(
    options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        FlightOptions(**options)  # type: ignore[arg-type]


def test_a_link_in_lockstep_needs_commands(tmp_path_factory: pytest.TempPathFactory) -> None:
    to = str(tmp_path_factory.mktemp("link") / "new.stream")
    with pytest.raises(InputError, match=r"needs commands, and .*new.stream has none: add --comm"):
        LinkOptions(to=to, lockstep=True).line(steered=True)
    with pytest.raises(InputError):
        LinkOptions(to="nowhere://x").line(steered=True)


def test_weather_checks_itself() -> None:
    with pytest.raises(InputError, match="--clear and --rain exclude each other"):
        Weather(rain=3.0, clear=True)
    with pytest.raises(InputError, match="--drops goes with --rain or --snow"):
        WeatherOfDrops(drops=True)
