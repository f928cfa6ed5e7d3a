"""The study file: reading ``study.toml``, checking all of it at once, and what it means.

Reading is cheap (no numerical library beyond numpy is loaded) and never runs the simulator.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from rsmkit.design.default_kind import default_design
from rsmkit.design.families.registry import design_options, option_classes, word_of
from rsmkit.design.options import DEFAULT_KIND, DesignOptions
from rsmkit.errors import RsmkitError, StudyError
from rsmkit.io.arguments import checked
from rsmkit.io.files.regular_files import read_regular
from rsmkit.io.option_fields import doc
from rsmkit.io.shown import Shown
from rsmkit.io.tables.tagged_tables import TaggedTable
from rsmkit.io.toml_tables import read_tables
from rsmkit.language.conditions import Constraint, parse_conditions
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Factor, Space
from rsmkit.optimum.options import SearchOptions
from rsmkit.report.options import ExplorerOptions
from rsmkit.runs.how_to_run import EvaluateOptions
from rsmkit.runs.options import SimulatorOptions
from rsmkit.study.limits import limited_space
from rsmkit.study.service import Service, numbers_of
from rsmkit.surfaces.kinds import AUTO, KINDS
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.variation.options import CorrelationOptions, LawOptions, PropagationOptions, Specification
from rsmkit.verification.options import VerifyOptions

__all__ = ["TAGGED", "FactorOptions", "ResponseOptions", "Study", "StudyFile", "load_study"]

FILE_NAME = "study.toml"
LARGEST_STUDY = 16 << 20
WHOLE_PLOT = "whole_plot"
"""What the groups within which hard factors keep their settings are called."""


@dataclass(frozen=True)
class FactorOptions:
    """One input that the study varies: bounds, or the values it may take."""

    low: float | None = doc("lower bound, natural units", None)
    high: float | None = doc("upper bound, natural units", None)
    label: str = doc("wording for tables and plots", "")
    unit: str = doc("unit shown with the label", "")
    integer: bool = doc("only whole numbers between the bounds", False)
    levels: tuple[float, ...] | tuple[str, ...] = doc("the only values allowed, instead of low and high", ())
    change: Literal["easy", "hard"] = doc(
        "hard: the factor keeps one setting in each whole plot of design.whole_plots (an oven, a furnace "
        "heat), and plots count as random groups in the fit",
        "easy",
    )

    def factor(self, name: str) -> Factor:
        """Make the factor, or raise with what is wrong with it."""
        nan = float("nan")
        low = nan if self.low is None else self.low
        high = nan if self.high is None else self.high
        return Factor(name, low, high, self.label, self.unit, self.integer, self.levels)


@dataclass(frozen=True)
class MixtureOptions:
    """Components of a mixture: factors whose amounts add up to a total in every run."""

    components: tuple[str, ...] = doc("continuous factors, at least two, that no other mixture holds")
    total: float = doc("their sum: 1 for fractions, 100 for percent", 1.0)


@dataclass(frozen=True)
class ResponseOptions:
    """One number the simulator returns, or its failure, that the study models."""

    label: str = doc("wording for tables and plots", "")
    unit: str = doc("unit shown with the label", "")
    distribution: Literal["binomial", "poisson"] | None = doc(
        "for a response that counts: successes among trials, or events over an exposure; surfaces, searches "
        "and verification are then of the probability, or of the rate per unit of exposure",
        None,
    )
    trials: float | str | None = doc(
        "with binomial: trials of each run, a number or the name of a factor, of another number that the "
        "simulator returns, or of a column of the run sheet; without it the response is 0 or 1",
        None,
    )
    exposure: float | str | None = doc(
        "with poisson: area, time, length of each run, a number or a name as for trials; 1 without it", None
    )

    failure: bool = doc(
        "with binomial: the response is the failure of the simulator, 1 for a run that raised, returned "
        "something unusable, took too long or died, 0 for one that came to a good end",
        False,
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if self.failure and self.distribution != "binomial":
            found.append(("failure", "goes with distribution = 'binomial'; set that, or leave it out"))
        if self.failure and self.trials is not None:
            found.append(("trials", "is 1 for the failure of a run; leave it out"))
        for key, value, owner in (
            ("trials", self.trials, "binomial"),
            ("exposure", self.exposure, "poisson"),
        ):
            if value is None:
                continue
            if self.distribution != owner:
                found.append((key, f"goes with distribution = '{owner}'; set that, or leave it out"))
            elif isinstance(value, str):
                found += [] if value else [(key, "is empty; give a number or a name")]
            elif not 0 < value < float("inf"):
                found.append((key, f"must be positive, got {value:g}"))
            elif key == "trials" and value != int(value):
                found.append((key, f"must be a whole number, got {value:g}"))
        return found

    def title(self, name: str) -> str:
        """Label with unit, for axes and table heads."""
        return f"{self.label or name} [{self.unit}]" if self.unit else self.label or name


@dataclass(frozen=True)
class StudyFile:
    """The whole of ``study.toml``, table by table."""

    factors: dict[str, FactorOptions] = doc("inputs that the study varies")
    responses: dict[str, ResponseOptions] = doc("numbers the simulator returns and the study models")
    name: str = doc("title of the study", "")
    simulator: SimulatorOptions | None = doc("what one run is", None)
    mixture: tuple[MixtureOptions, ...] = doc(
        "factors whose amounts add up to a total; [[mixture]] for each of several", ()
    )
    functions: dict[str, str] = doc(
        "cheap quantities computed from the factors, name = 'module:function'; usable in every expression",
        factory=dict,
    )
    design: DesignOptions = doc("which points to run", factory=design_options)
    evaluate: EvaluateOptions = doc("where the runs are made", factory=EvaluateOptions)
    surface: SurfaceOptions = doc("which model each response gets", factory=SurfaceOptions)
    search: tuple[SearchOptions, ...] = doc("searches for an optimum on the surfaces", ())
    uncertainty: dict[str, LawOptions] = doc("how factors and settings vary in service", factory=dict)
    correlation: CorrelationOptions | None = doc("how the laws of service are correlated", None)
    specifications: dict[str, Specification] = doc("what the responses must keep to in service", factory=dict)
    propagation: PropagationOptions = doc(
        "how the laws are carried through the surfaces", factory=PropagationOptions
    )
    verify: VerifyOptions = doc("which optima are run for real, and what counts", factory=VerifyOptions)
    explorer: ExplorerOptions = doc("extras of the explorer page", factory=ExplorerOptions)


GROUPED = (*(word for word, kind in KINDS.items() if kind.is_word and kind.grouped != "never"), AUTO)
"""Surface models that fit runs in random groups."""

TAGGED = (TaggedTable(DesignOptions, "kind", DEFAULT_KIND, option_classes, word_of),)
"""Tables of which one key says which others there are."""


@dataclass(frozen=True)
class Study(Shown):
    """A study file that was found in order, and the folder its stages work in."""

    path: Path
    file: StudyFile
    space: Space

    @property
    def folder(self) -> Path:
        """Where the study's artefacts live."""
        return self.path.parent

    @property
    def name(self) -> str:
        """Title of the study."""
        return self.file.name or self.folder.resolve().name

    @property
    def responses(self) -> tuple[str, ...]:
        """Names of the modelled responses, in order."""
        return tuple(self.file.responses)

    @property
    def failures(self) -> tuple[str, ...]:
        """Responses that are the failure of the simulator."""
        return tuple(name for name, options in self.file.responses.items() if options.failure)

    @property
    def asked(self) -> tuple[str, ...]:
        """Names of the responses that the simulator returns: all but its failure."""
        return tuple(name for name in self.responses if name not in self.failures)

    @property
    def counts(self) -> dict[str, ResponseOptions]:
        """Responses that are counts."""
        return {name: options for name, options in self.file.responses.items() if options.distribution}

    @property
    def deterministic(self) -> bool:
        """Whether the same point always gives the same responses; laboratory runs do not."""
        return self.file.simulator is not None and self.file.simulator.deterministic

    @property
    def service(self) -> Service:
        """Laws of what varies in service."""
        file, settings = self.file, self.file.simulator.settings if self.file.simulator else {}
        return Service(self.space, self.folder, file.uncertainty, file.correlation, numbers_of(settings))

    @property
    def hard(self) -> tuple[str, ...]:
        """Factors that are hard to change: they keep one setting in each whole plot."""
        return tuple(name for name, options in self.file.factors.items() if options.change == "hard")

    @property
    def random(self) -> tuple[str, ...]:
        """Kinds of groups whose effects are random: whole plots, and columns of the run sheet."""
        return ((WHOLE_PLOT,) if self.hard else ()) + self.file.design.random

    @property
    def searches(self) -> tuple[SearchOptions, ...]:
        """The searches in order."""
        return self.file.search

    def design_constraints(self) -> tuple[Constraint, ...]:
        """Inequalities that every design point must satisfy (in factors and functions only).

        Equalities among the constraints are no business of the points: the space has them.
        """
        return parse_conditions(self.file.design.subject_to, categories=self.space.categories).constraints


def locate_study(place: str | Path = ".") -> Path:
    """Turn a folder, or the path of a study file, into the path of the study file."""
    path = Path(place)
    if path.is_dir():
        path = path / FILE_NAME
    if not path.is_file() and not path.is_fifo():  # which is refused when it is read
        where = path.parent if path.name == FILE_NAME else path
        raise RsmkitError(
            f"no study found: {where} {'has no ' + FILE_NAME if where.is_dir() else 'does not exist'}. "
            f"Name a folder with a {FILE_NAME}, or make one with: rsmkit new DIR"
        )
    return path


@checked
def load_study(place: str | Path = ".") -> Study:
    """Read and check a study.

    Parameters
    ----------
    place : path
        Folder with a ``study.toml``, or the file itself.

    Raises
    ------
    StudyError
        Listing every problem in the file.
    RsmkitError
        If there is no such file.
    """
    path = locate_study(place)
    try:
        data = tomllib.loads(read_regular(path, LARGEST_STUDY).decode("utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise StudyError(path.name, [f"not valid TOML: {error}"]) from None
    except UnicodeDecodeError as error:
        raise StudyError(path.name, [f"is not UTF-8 text ({error.reason} at byte {error.start})"]) from None
    except ValueError:
        raise StudyError(path.name, ["not valid TOML: a number has too many digits"]) from None
    except OSError as error:
        raise RsmkitError(f"{path}: cannot be read: {error.strerror}") from None
    except RecursionError:
        raise StudyError(path.name, ["is nested too deeply"]) from None
    if isinstance(data.get("mixture"), dict):
        data["mixture"] = [data["mixture"]]
    parts, problems = read_tables(data, StudyFile, TAGGED)
    file = StudyFile(**{"factors": {}, "responses": {}, **parts})
    factors, found = _make_factors(file)
    problems += found + _cross_check(file, data)
    if problems:
        raise StudyError(path.name, problems)
    space, problems = limited_space(
        Space(factors),
        mixtures=file.mixture,
        subject_to=file.design.subject_to,
        searches=file.search,
        uncertain=tuple(file.uncertainty),
        hard=[name for name, options in file.factors.items() if options.change == "hard"],
    )
    if problems:
        raise StudyError(path.name, problems)
    if "kind" not in data.get("design", {}):
        file = replace(
            file, design=default_design(file.design, space, file.surface.terms, file.surface.order)
        )
    study = Study(path, file, space)
    problems = study.service.problems()
    if problems:
        raise StudyError(path.name, problems)
    return study


def _make_factors(file: StudyFile) -> tuple[list[Factor], list[str]]:
    factors, problems = [], []
    for name, options in file.factors.items():
        try:
            factors.append(options.factor(name))
        except RsmkitError as error:
            problems.append(f"factors.{name}: {str(error).removeprefix(f'factor {name}: ')}")
    return factors, problems


def _cross_check(file: StudyFile, data: dict[str, Any]) -> list[str]:
    """Check what one table says against the others; `data` still has the names of tables in error."""
    problems = []
    groups = {key: _names(data.get(key)) for key in ("factors", "responses", "functions")}
    if "factors" in data and not groups["factors"]:
        problems.append("factors is empty; name an input, e.g. radius_m = { low = 0.1, high = 0.3 }")
    if "responses" in data and not groups["responses"]:
        problems.append("responses is empty; name a number your simulator returns, e.g. mass_kg = {}")
    settings = file.simulator.settings if file.simulator else {}
    uses = Counter(name for group in groups.values() for name in group)
    for name, count in uses.items():
        where = " and ".join(key for key, group in groups.items() if name in group)
        if not name.isidentifier() or name == "pi":
            problems.append(
                f"{where}.{name}: a name has only letters, digits and underscores, and is not 'pi'"
            )
        elif count > 1:
            problems.append(f"{name} is named in {where}; use different names")
        elif name in settings and name in groups["factors"]:
            problems.append(f"{name} is a factor and a simulator setting; remove it from simulator.settings")
    for name, target in file.functions.items():
        if target.count(":") != 1 or not all(p.isidentifier() for p in target.replace(":", ".").split(".")):
            problems.append(f"functions.{name} must look like 'module:function', got \"{target}\"")

    problems += _check_groups(file, set(uses)) + _check_counts(file)
    cheap = [*groups["factors"], *groups["functions"]]
    categories = {
        name: tuple(map(str, options.levels))
        for name, options in file.factors.items()
        if options.levels and isinstance(options.levels[0], str)
    }

    def conditions(text: str, known: list[str]) -> object:
        return parse_conditions([text], known, categories, groups["factors"])

    known = [*cheap, *groups["responses"]]
    for index, text in enumerate(file.design.subject_to):
        problems += _try(f"design.subject_to[{index}]:", conditions, text, cheap)
    plain = known
    for search in file.search:
        known = plain
        if search.service is not None:
            known = [*plain, *_service_names(groups["responses"], file)]
            if not any(name in groups["factors"] for name in file.uncertainty):
                problems.append(f"search {search.name}: service needs a factor with a law in [uncertainty]")
        for text in search.objectives:
            key = "desirability" if search.desirability else "minimize"
            problems += _try(f"search {search.name}: {key}:", parse_expression, text, known)
        if search.robust:
            have = ", ".join(groups["factors"])
            problems += [
                f"search {search.name}: robust.noise.{name} is no factor (factors: {have})"
                for name in search.robust.noise
                if name not in groups["factors"]
            ]
        for text in search.subject_to:
            problems += _try(f"search {search.name}: subject_to:", conditions, text, known)
    problems += _check_service(file, groups["factors"], groups["responses"])
    names = Counter(search.name for search in file.search)
    problems += [
        f"search: the name {name} is used {count} times; give each its own"
        for name, count in names.items()
        if count > 1
    ]
    searches = data.get("search", [])
    all_read = isinstance(searches, list) and len(file.search) == len(searches)
    for name in file.verify.searches:
        if name not in names and all_read:
            have = ", ".join(names) or "none"
            problems.append(f"verify.searches names {name}, which is no search (searches: {have})")
    return problems


def _service_names(responses: list[str], file: StudyFile) -> tuple[str, ...]:
    from rsmkit.optimum.service.in_service import service_names

    return service_names(responses, tuple(file.specifications))


def _check_service(file: StudyFile, factors: list[str], responses: list[str]) -> list[str]:
    """Check the names that the tables of service use."""
    settings = numbers_of(file.simulator.settings) if file.simulator else {}
    searches = [search.name for search in file.search]
    correlated = file.correlation.factors if file.correlation else ()
    wanted = file.propagation.search
    checks = [
        (f"uncertainty.{name}", "factor or numeric setting", name, [*factors, *settings])
        for name in file.uncertainty
    ]
    checks += [(f"specifications.{name}", "response", name, responses) for name in file.specifications]
    checks += [
        ("correlation.factors", "law of [uncertainty]", name, [*file.uncertainty]) for name in correlated
    ]
    checks += [("propagation.map", "factor", name, factors) for name in file.propagation.map]
    checks += [("propagation.search", "search", wanted, searches)] if wanted else []
    return [
        f"{key}: {name} is no {kind} ({', '.join(known) or 'there is none'})"
        for key, kind, name, known in checks
        if name not in known
    ]


def _check_groups(file: StudyFile, used: set[str]) -> list[str]:
    """Check hard factors and random groups against the rest of the file."""
    hard = [name for name, options in file.factors.items() if options.change == "hard"]
    random, problems = file.design.random, list[str]()
    if hard and file.simulator is not None and file.simulator.deterministic:
        problems.append(
            f"factors.{hard[0]}.change: runs of a deterministic simulator differ by no error, so plots mean "
            "nothing; leave change out, or set simulator.deterministic = false"
        )
    if hard and len(hard) == len(file.factors):
        problems.append(
            "factors: every factor has change = 'hard'; one that is set anew for each run is needed, or no "
            "plots"
        )
    if hard and file.surface.model not in GROUPED:
        problems.append(
            f"surface.model = '{file.surface.model}' takes runs as independent, and those of a whole plot "
            f"are not; take {' or '.join(repr(word) for word in GROUPED)}"
        )
    for name in random:
        if name in used or name == WHOLE_PLOT or not name:
            problems.append(
                f"design.random: '{name}' is the name of something else; name a column of its own"
            )
    return problems


def _check_counts(file: StudyFile) -> list[str]:
    """Check responses that are counts against the rest of the file."""
    hard = any(options.change == "hard" for options in file.factors.values())
    problems = []
    failures = [name for name, options in file.responses.items() if options.failure]
    if failures and file.simulator is None:
        problems.append(
            f"responses.{failures[0]}.failure: there is no simulator that could fail; leave failure out, and "
            "write 1 or 0 into the run sheet"
        )
    if failures and len(failures) == len(file.responses):
        problems.append(
            f"responses: {failures[0]} is whether a run fails; name a number that the simulator returns, too"
        )
    for name, options in file.responses.items():
        if options.distribution and (hard or file.design.random):
            problems.append(
                f"responses.{name}.distribution: counts in random groups (hard factors, design.random) "
                "cannot be fitted; leave the distribution or the groups out"
            )
        for key, value in (("trials", options.trials), ("exposure", options.exposure)):
            if value == name:
                problems.append(f"responses.{name}.{key} is the response itself; name another number")
            levels = file.factors[value].levels if value in file.factors else ()
            if levels and isinstance(levels[0], str):
                problems.append(f"responses.{name}.{key}: factor {value} holds texts; name a number")
    return problems


def _names(table: object) -> list[str]:
    return list(table) if isinstance(table, dict) else []


def _try(key: str, parse: Callable[[str, list[str]], object], text: str, known: list[str]) -> list[str]:
    try:
        parse(text, known)
    except RsmkitError as error:
        return [f"{key} {error}"]
    return []
