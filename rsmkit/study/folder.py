"""A study's folder: what its stages have left there, what of it is out of date and why.

Every look at a study's files goes through one object, which reads each file once and remembers what it has
written. The stages make things; the folder keeps them.

===========================  =====================================================
file                         kept by
===========================  =====================================================
``design.csv, plan.json``    :meth:`StudyFolder.keep_plan`
``runs.jsonl``               the journal, run by run
``run-order.json``           :mod:`rsmkit.stages.by_hand.kept_order`
``model.json, optimum.json`` :meth:`StudyFolder.keep_fit`
``verification.json``        :meth:`StudyFolder.keep_verification`
``refinement.json``          :meth:`StudyFolder.keep_refinements`
``uncertainty.json``         :meth:`StudyFolder.keep_uncertainty`
===========================  =====================================================
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.errors import DamagedError, RsmkitError, RunsFailedError, StageError
from rsmkit.io.arguments import checked
from rsmkit.io.files.atomic_files import read_text
from rsmkit.io.files.digests import digest
from rsmkit.io.json_codec import from_json, read_json, to_json, write_json
from rsmkit.io.toml_tables import read_tables
from rsmkit.language.space import Space
from rsmkit.study.changes import changes
from rsmkit.study.exploring import Explorable
from rsmkit.study.file import Study, StudyFile, load_study
from rsmkit.study.keepings import Fitted, KeptRuns, Plan
from rsmkit.study.run_counts import INDEX_FILE, RunIndex, Sources, Standing, journal_state

if TYPE_CHECKING:  # these load the numerical libraries, which a look at a small file does not need
    from collections.abc import Mapping

    from rsmkit.design.design import Design
    from rsmkit.design.quality.assessment import Quality
    from rsmkit.optimum.optimum import Optimum
    from rsmkit.runs.one_run.simulator import Simulator
    from rsmkit.runs.record.design_runs import DesignRuns
    from rsmkit.runs.record.journal import Journal
    from rsmkit.runs.record.row_states import RowStates
    from rsmkit.runs.record.run import Run
    from rsmkit.surfaces.choose import Choice
    from rsmkit.variation.findings_of_laws import Uncertainty
    from rsmkit.verification.options import VerifyOptions
    from rsmkit.verification.refinement.refinement import RefinementRecord
    from rsmkit.verification.verification import Verification

__all__ = ["Fitted", "KeptRuns", "Plan", "StudyFolder", "open_study"]

DESIGN_FILE = "design.csv"
PLAN_FILE = "plan.json"
JOURNAL_FILE = "runs.jsonl"
TABLE_FILE = "responses.csv"
MODEL_FILE = "model.json"
OPTIMUM_FILE = "optimum.json"
VERIFICATION_FILE = "verification.json"
REFINEMENT_FILE = "refinement.json"
UNCERTAINTY_FILE = "uncertainty.json"
COMPARISON_FILE = "comparison.json"
EXPLORER_FILE = "explorer.html"

REDO_PLAN = "Run: rsmkit plan --force"
REDO_FIT = "Run: rsmkit fit --force"
REDO_VERIFY = "Run: rsmkit verify --force"
REDO_REFINE = "Run: rsmkit verify --refine"


class StudyFolder(Explorable):
    """The artefacts of one study.

    Parameters
    ----------
    study : Study
        The checked study file; the artefacts lie beside it.
    """

    def __init__(self, study: Study) -> None:
        self.study = study
        self.path = study.folder
        self._documents: dict[str, dict[str, Any]] = {}
        self._text: str | None = None
        self._hashed: tuple[str, str] | None = None
        self._keys: list[str] = []
        self._plan: Plan | None = None
        self._design_runs: tuple[Plan, Mapping[str, Run], DesignRuns] | None = None
        self._fitted: Fitted | None = None

    # ------------------------------------------------------------------ plan

    def plan_problem(self) -> str | None:
        """Say why the plan stage must run (again), or None when ``design.csv`` is up to date."""
        from rsmkit.study.records import plan_record

        path = self.path / DESIGN_FILE
        if not path.is_file() or not (self.path / PLAN_FILE).is_file():
            return "there is no design yet"
        record = self._read(PLAN_FILE, REDO_PLAN)
        made_from = record.get("made_from")
        now = plan_record(self.study)
        if isinstance(made_from, dict) and "runs" in made_from:  # then the design depends on these, too
            now["runs"] = self._runs_made_by()
        different = changes(made_from, now)
        if different:
            return f"{DESIGN_FILE} was made from another study file ({'; '.join(different)})"
        if self._plan is None and record.get("design") != self._design_digest():
            return f"{DESIGN_FILE} was edited since (to use your own points, set design.kind = 'file')"
        return None

    def plan(self) -> Plan:
        """Read the design of an up-to-date plan stage.

        Raises
        ------
        StageError
            If the stage is missing or out of date.
        """
        problem = self.plan_problem()
        if problem:
            raise StageError(f"{problem}. Run: rsmkit plan {'' if self.path == Path() else self.path}")
        if self._plan is None:
            from rsmkit.design.design import Design
            from rsmkit.design.quality.assessment import Quality

            design = Design.from_text(self._design_text(), self.path / DESIGN_FILE, self.study.space)
            record, where = self._read(PLAN_FILE, REDO_PLAN), self.path / PLAN_FILE
            quality = from_json(Quality, record.get("quality"), where, REDO_PLAN, at="quality")
            kept = record.get("kept")
            told = None if kept is None else from_json(KeptRuns, kept, where, REDO_PLAN, at="kept")
            self._plan = Plan(design, quality, told)
        return self._plan

    def last_design(self) -> Design | None:
        """Read the design on the disk in the space it was made for; None when that cannot be done."""
        from rsmkit.design.design import Design

        try:
            origin = self._read(PLAN_FILE, REDO_PLAN).get("made_from") or {}
            options = read_tables({"factors": origin.get("factors"), "responses": {}}, StudyFile)[0]
            factors = [made.factor(name) for name, made in options["factors"].items()]
            return Design.from_text(self._design_text(), self.path / DESIGN_FILE, Space(factors))
        except (RsmkitError, AttributeError, KeyError):
            return None

    def earlier_runs(self) -> frozenset[str]:
        """Keys of runs that were part of an earlier design, and not of that on the disk."""
        try:
            kept = self._read(PLAN_FILE, REDO_PLAN).get("kept")
            return frozenset(from_json(KeptRuns, kept, self.path / PLAN_FILE, REDO_PLAN, at="kept").earlier)
        except RsmkitError:
            return frozenset()

    def _runs_made_by(self) -> str:
        """What a design that was made around earlier runs depends on beside the study's other tables."""
        if not self.journal.path.exists():
            return f"no {JOURNAL_FILE}"
        options = self.simulator.options
        return digest([self.simulator.identity, options.settings, options.defaults])

    def keep_plan(
        self, design: Design, quality: Quality, kept: KeptRuns | None = None, *, around: bool = False
    ) -> Plan:
        """Write the design, what it can do, what it has of earlier runs, whether it was made around them."""
        from rsmkit.study.records import plan_record

        design.to_csv(self.path / DESIGN_FILE)
        self._plan, self._text = Plan(design, quality, kept), None
        made_from = plan_record(self.study)
        if around:
            made_from["runs"] = self._runs_made_by()
        document = {
            "schema": 1,
            "made_from": made_from,
            "design": self._design_digest(),
            "quality": quality.to_json(),
        }
        self._write(PLAN_FILE, document | ({"kept": to_json(kept)} if kept else {}))
        return self._plan

    # ------------------------------------------------------------------ runs

    @cached_property
    def journal(self) -> Journal:
        """The record of all runs."""
        from rsmkit.runs.record.journal import Journal

        return Journal(self.path / JOURNAL_FILE)

    @cached_property
    def simulator(self) -> Simulator:
        """The study's simulator; without one, the stand-in by which laboratory runs are found."""
        from rsmkit.runs.one_run.simulator import Simulator
        from rsmkit.runs.sheets.hand_runs import laboratory

        options = self.study.file.simulator
        return laboratory(self.path) if options is None else Simulator(options, self.path)

    def design_runs(self) -> DesignRuns:
        """Look up the runs of the design's points."""
        from rsmkit.runs.agenda import make_agenda
        from rsmkit.runs.record.design_runs import DesignRuns
        from rsmkit.runs.sheets.hand_runs import added_runs

        plan, recorded = self.plan(), self.journal.load()
        known = self._design_runs
        if known is None or known[0] is not plan or known[1] is not recorded:
            space, responses = self.study.space, self.study.asked
            agenda = make_agenda(self.simulator, plan.design.points, space, self.journal, responses=responses)
            runs, self._keys = agenda.table(space, responses), agenda.keys
            added = None if self.study.file.simulator else added_runs(runs, recorded)
            known = self._design_runs = plan, recorded, DesignRuns(runs, added, self._keys)
        return known[2]

    def fit_runs(self) -> DesignRuns:
        """Read the runs a fit may use: every design point must have been run, well or badly.

        Raises
        ------
        StageError
            If there is no up-to-date design, or points have not been run.
        RunsFailedError
            If no run succeeded.
        """
        evaluation = self.design_runs()
        if evaluation.missing:
            by_hand = "Record them, or say in the run sheet why they are excluded: rsmkit record FILE.csv"
            remedy = "Run: rsmkit evaluate" if self.study.file.simulator else by_hand
            raise StageError(
                f"{evaluation.missing} of {evaluation.distinct} runs have not been made. {remedy}"
            )
        if not len(evaluation.usable):
            if not evaluation.failed:
                raise RunsFailedError(f"nothing to fit: {evaluation.words}")
            raise RunsFailedError(
                f"all {evaluation.failed} runs failed ({evaluation.errors[0]}). "
                "Repair the simulator, then run: rsmkit evaluate --retry-failed"
            )
        return evaluation

    @property
    def is_large(self) -> bool:
        """Whether the journal is so large that its standing is kept beside it."""
        return bool(journal_state(self.journal.path))

    @cached_property
    def _index(self) -> RunIndex:
        points, is_read = lambda: self.plan().design.points, lambda: self._design_runs is not None
        sources = Sources(self._design_digest, points, self._count, is_read)
        return RunIndex(self.path / INDEX_FILE, self.study, self.journal, self.simulator, sources)

    def standing(self) -> Standing:
        """How far the runs of the design have come; of a large journal without reading it again."""
        return self._index.counted().standing

    def row_states(self) -> RowStates | None:
        """How far each row of a large design has come; None where that is for the journal to say."""
        return self._index.counted().rows if self.is_large else None

    def keep_standing(self) -> Standing:
        """Count the runs of a large journal anew, all of what is kept of them."""
        return self._index.counted(anew=self.is_large).standing

    def _count(self) -> tuple[Standing, list[str], DesignRuns]:
        from rsmkit.study.records import measured

        runs, design = self.design_runs(), self.plan().design
        counts = runs.distinct, runs.done, runs.failed, runs.missing, len(runs.usable)
        taken = {} if self.study.random or self.study.counts else measured(self.study, design, runs)
        return Standing(len(design), *counts, runs.words, taken), self._keys, runs

    def _measured(self) -> dict[str, str]:
        """Hashes of what a fit takes from the runs, every one of which must have been made."""
        from rsmkit.study.records import measured

        state = self.standing()
        state = state if state.measured or state.missing else self.keep_standing()
        if not state.measured or state.missing or not state.usable:
            return measured(self.study, self.plan().design, self.fit_runs())
        return state.measured

    # ------------------------------------------------------------------ fit

    def fit_problem(self) -> str | None:
        """Say why the fit stage must run (again), or None when its files are up to date."""
        from rsmkit.study.records import fit_record, search_record

        for file in (MODEL_FILE, OPTIMUM_FILE):
            if not (self.path / file).is_file():
                return "there is no model yet" if file == MODEL_FILE else "there is no optimum yet"
        model = self._read(MODEL_FILE, REDO_FIT)
        different = changes(model.get("made_from"), fit_record(self.study, self._measured()))
        if different:
            return f"{MODEL_FILE} is out of date ({'; '.join(different)})"
        optimum = self._read(OPTIMUM_FILE, REDO_FIT)
        different = changes(optimum.get("made_from"), search_record(self.study, model["made_from"]))
        return f"{OPTIMUM_FILE} is out of date ({'; '.join(different)})" if different else None

    def fitted(self) -> Fitted:
        """Read the surfaces and optima of an up-to-date fit stage.

        Raises
        ------
        StageError
            If the stage is missing or out of date.
        """
        self.plan()  # if that is missing, it comes first
        problem = self.fit_problem()
        if problem:
            raise StageError(f"{problem}. Run: rsmkit fit")
        if self._fitted is None:
            from rsmkit.study.counts import as_rates

            evaluation = self.fit_runs()
            responses, objectives = (self._choices(part) for part in ("responses", "objectives"))
            if set(responses) != set(self.study.responses):
                raise DamagedError(
                    self.path / MODEL_FILE, ["its responses are not those of the study"], REDO_FIT
                )
            runs = as_rates(self.study, evaluation.usable)
            self._fitted = Fitted(runs, evaluation.failed, responses, objectives, self._optima())
        return self._fitted

    def keep_fit(self, fitted: Fitted) -> None:
        """Write ``model.json`` and ``optimum.json``."""
        from rsmkit.study.records import fit_record, measured, search_record

        made_from = fit_record(self.study, measured(self.study, self.plan().design, self.fit_runs()))
        choices = fitted.responses | fitted.objectives
        reports = {name: choice.report() for name, choice in choices.items()}  # tests are kept by surfaces
        model = {
            "schema": 1,
            "made_from": made_from,
            "responses": {name: choice.to_json() for name, choice in fitted.responses.items()},
            "objectives": {text: choice.to_json() for text, choice in fitted.objectives.items()},
            "reports": reports,
        }
        optimum = {
            "schema": 1,
            "made_from": search_record(self.study, made_from),
            "searches": [found.to_json() for found in fitted.optima],
        }
        self._write(MODEL_FILE, model)
        self._write(OPTIMUM_FILE, optimum)
        if not self.standing().measured:
            self.keep_standing()
        self._fitted = fitted

    def _choices(self, part: str) -> dict[str, Choice]:
        """Read the surfaces under one key of the model file."""
        from rsmkit.surfaces.choose import Choice

        document = self._read(MODEL_FILE, REDO_FIT).get(part)
        return from_json(dict[str, Choice], document, self.path / MODEL_FILE, REDO_FIT, at=part)

    def _optima(self) -> tuple[Optimum, ...]:
        """Read what the searches found."""
        from rsmkit.optimum.optimum import OptimumForm

        space, path = self.study.space, self.path / OPTIMUM_FILE
        searches = self._read(OPTIMUM_FILE, REDO_FIT).get("searches")
        forms = from_json(tuple[OptimumForm, ...], searches, path, REDO_FIT, at="searches")
        problems = [f"searches[{i}]: {text}" for i, form in enumerate(forms) for text in form.problems(space)]
        if len(forms) != len(self.study.searches):
            problems.append("its searches are not those of the study")
        if problems:
            raise DamagedError(path, problems, REDO_FIT)
        return tuple(form.optimum(space) for form in forms)

    # ------------------------------------------------------------------ verify and refine

    def verify_problem(self, options: VerifyOptions | None = None) -> str | None:
        """Say why the verify stage must run (again), or None when its file is up to date."""
        from rsmkit.study.records import verify_record

        if not (self.path / VERIFICATION_FILE).is_file():
            return "nothing is verified yet"
        record = self._read(VERIFICATION_FILE, REDO_VERIFY)
        made_from = verify_record(self._read(OPTIMUM_FILE, REDO_FIT), options or self.study.file.verify)
        different = changes(record.get("made_from"), made_from)
        return f"{VERIFICATION_FILE} is out of date ({'; '.join(different)})" if different else None

    def verification(self, options: VerifyOptions | None = None) -> Verification:
        """Read an up-to-date verification.

        Raises
        ------
        StageError
            If there is none.
        """
        from rsmkit.verification.verification import Verification

        problem = self.verify_problem(options)
        if problem:
            raise StageError(f"{problem}. Run: rsmkit verify")
        path = self.path / VERIFICATION_FILE
        return from_json(Verification, self._read(VERIFICATION_FILE, REDO_VERIFY), path, REDO_VERIFY)

    def keep_verification(self, verification: Verification, options: VerifyOptions) -> Path:
        """Write ``verification.json``; give its path."""
        from rsmkit.study.records import verify_record

        made_from = verify_record(self._read(OPTIMUM_FILE, REDO_FIT), options)
        return self._write(VERIFICATION_FILE, {"schema": 1, "made_from": made_from, **to_json(verification)})

    def refinements(self) -> dict[str, RefinementRecord]:
        """Read the refinements of the present optima by search; empty when there are none, or older ones."""
        if not (self.path / REFINEMENT_FILE).is_file():
            return {}
        record = self._read(REFINEMENT_FILE, REDO_REFINE)
        if record.get("made_from") != self._refined_from():
            return {}
        from rsmkit.verification.refinement.refinement import RefinementRecord

        path, searches = self.path / REFINEMENT_FILE, record.get("searches")
        return from_json(dict[str, RefinementRecord], searches, path, REDO_REFINE, at="searches")

    def keep_refinements(self, searches: Mapping[str, RefinementRecord]) -> Path:
        """Write ``refinement.json``; give its path."""
        return self._write(
            REFINEMENT_FILE, {"schema": 1, "made_from": self._refined_from(), "searches": to_json(searches)}
        )

    def _refined_from(self) -> dict[str, str]:
        return {"optimum": digest(self._read(OPTIMUM_FILE, REDO_FIT))}

    def uncertainty(self) -> Uncertainty | None:
        """Read what the laws of service do about the present optimum; None when that is to be found anew."""
        from rsmkit.study.records import uncertainty_record

        if not (self.path / UNCERTAINTY_FILE).is_file():
            return None
        record = self._read(UNCERTAINTY_FILE, REDO_FIT)
        if record.get("made_from") != uncertainty_record(self.study, self._read(OPTIMUM_FILE, REDO_FIT)):
            return None
        from rsmkit.variation.findings_of_laws import Uncertainty

        return from_json(Uncertainty, record, self.path / UNCERTAINTY_FILE, REDO_FIT)

    def keep_uncertainty(self, found: Uncertainty) -> Path:
        """Write ``uncertainty.json``; give its path."""
        from rsmkit.study.records import uncertainty_record

        made_from = uncertainty_record(self.study, self._read(OPTIMUM_FILE, REDO_FIT))
        return self._write(UNCERTAINTY_FILE, {"schema": 1, "made_from": made_from, **to_json(found)})

    def keep_comparison(self, searches: list[dict[str, Any]]) -> Path:
        """Write ``comparison.json``; give its path."""
        return self._write(COMPARISON_FILE, {"schema": 1, "searches": searches})

    # ------------------------------------------------------------------ inside

    def _design_text(self) -> str:
        if self._text is None:
            self._text = read_text(self.path / DESIGN_FILE, REDO_PLAN)
        return self._text

    def _design_digest(self) -> str:
        """Hash of the design's text; of a million rows that takes a while, so it is made once."""
        text = self._design_text()
        if self._hashed is None or self._hashed[0] is not text:
            self._hashed = text, digest(text)
        return self._hashed[1]

    def _read(self, name: str, remedy: str) -> dict[str, Any]:
        if name not in self._documents:
            self._documents[name] = read_json(self.path / name, remedy)
        return self._documents[name]

    def _write(self, name: str, document: dict[str, Any]) -> Path:
        write_json(self.path / name, document)
        self._documents[name] = document
        return self.path / name


@checked
def open_study(place: str | Path = ".") -> StudyFolder:
    """Read and check a study file, and open the folder it lies in.

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
    return StudyFolder(load_study(place))
