"""rsmkit: response surfaces and designed experiments for expensive simulators.

Plan about fifty runs, fit second-order surfaces, find the optimum on them for free, and prove it on the real
simulation. From the command line see ``rsmkit --help``; from Python start with::

    import rsmkit as rk
    space = rk.Space(width_mm=(30, 60), height_mm=(90, 120))
    design = rk.augment(rk.ccd(space, star="inscribed", center=1), 14, min_distance=0.2)
    runs = rk.evaluate("simulator:cantilever", design)
    surfaces = rk.fit(runs)
    best = rk.search(surfaces, "mass_kg", subject_to=["sag_mm <= 10"])
    rk.verify(best, "simulator:cantilever", surfaces, runs)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:  # for type checkers and editors; the table below is what Python looks up
    from rsmkit import plots as plots
    from rsmkit import testing as testing
    from rsmkit.api import evaluate as evaluate
    from rsmkit.api import explorer as explorer
    from rsmkit.api import fit as fit
    from rsmkit.api import refine as refine
    from rsmkit.api import search as search
    from rsmkit.api import verify as verify
    from rsmkit.design.design import Design as Design
    from rsmkit.design.families.box_behnken import box_behnken as box_behnken
    from rsmkit.design.families.composite import ccd as ccd
    from rsmkit.design.families.mixtures.blend_designs import extreme_vertices as extreme_vertices
    from rsmkit.design.families.mixtures.blend_designs import simplex_centroid as simplex_centroid
    from rsmkit.design.families.mixtures.blend_designs import simplex_lattice as simplex_lattice
    from rsmkit.design.families.space_filling import fill as fill
    from rsmkit.design.families.space_filling import halton as halton
    from rsmkit.design.families.space_filling import latin_hypercube as latin_hypercube
    from rsmkit.design.families.space_filling import sobol as sobol
    from rsmkit.design.families.three_level import component_relation as component_relation
    from rsmkit.design.families.three_level import interaction_components as interaction_components
    from rsmkit.design.families.three_level import three_level_blocks as three_level_blocks
    from rsmkit.design.families.three_level import three_level_fraction as three_level_fraction
    from rsmkit.design.families.two_level.factorial import fractional_factorial as fractional_factorial
    from rsmkit.design.families.two_level.factorial import full_factorial as full_factorial
    from rsmkit.design.families.two_level.factorial_blocks import confounded_effects as confounded_effects
    from rsmkit.design.families.two_level.factorial_blocks import in_blocks as in_blocks
    from rsmkit.design.families.two_level.factorial_blocks import standard_blocks as standard_blocks
    from rsmkit.design.families.two_level.screening import definitive_screening as definitive_screening
    from rsmkit.design.families.two_level.screening import plackett_burman as plackett_burman
    from rsmkit.design.optimal.optimal_design import augment as augment
    from rsmkit.design.optimal.optimal_design import optimal_design as optimal_design
    from rsmkit.design.optimal.split_plot import split_plot_design as split_plot_design
    from rsmkit.design.quality.aliasing import alias_matrix as alias_matrix
    from rsmkit.design.quality.aliasing import term_correlations as term_correlations
    from rsmkit.design.quality.allocation import allocate_runs as allocate_runs
    from rsmkit.design.quality.assessment import Quality as Quality
    from rsmkit.design.quality.assessment import assess as assess
    from rsmkit.design.quality.design_comparison import compare_designs as compare_designs
    from rsmkit.design.quality.information import information_matrix as information_matrix
    from rsmkit.design.quality.power import power_of_terms as power_of_terms
    from rsmkit.design.quality.screening_power import screening_power as screening_power
    from rsmkit.design.quality.structure import design_structure as design_structure
    from rsmkit.design.quality.time_trends import run_order_trends as run_order_trends
    from rsmkit.design.quality.variance import design_space_fraction as design_space_fraction
    from rsmkit.design.quality.variance import variance_profile as variance_profile
    from rsmkit.design.region import ball as ball
    from rsmkit.design.region import box as box
    from rsmkit.design.region import candidate_list as candidate_list
    from rsmkit.errors import FitError as FitError
    from rsmkit.errors import RsmkitError as RsmkitError
    from rsmkit.errors import RunsFailedError as RunsFailedError
    from rsmkit.errors import StageError as StageError
    from rsmkit.errors import StudyError as StudyError
    from rsmkit.language.conditions import parse_constraint as parse_constraint
    from rsmkit.language.conditions import parse_equality as parse_equality
    from rsmkit.language.equalities import Equality as Equality
    from rsmkit.language.equalities import Mixture as Mixture
    from rsmkit.language.expression import parse_expression as parse_expression
    from rsmkit.language.scheffe import scheffe_terms as scheffe_terms
    from rsmkit.language.space import Factor as Factor
    from rsmkit.language.space import Space as Space
    from rsmkit.language.space_terms import space_terms as space_terms
    from rsmkit.language.terms import Terms as Terms
    from rsmkit.language.terms import full_terms as full_terms
    from rsmkit.language.terms import parse_terms as parse_terms
    from rsmkit.optimum.desirability import Desire as Desire
    from rsmkit.optimum.desirability import desirability as desirability
    from rsmkit.optimum.optimum import Optimum as Optimum
    from rsmkit.optimum.options import SearchOptions as SearchOptions
    from rsmkit.optimum.pareto_front import hypervolume as hypervolume
    from rsmkit.optimum.pareto_front import nondominated as nondominated
    from rsmkit.optimum.problem import Problem as Problem
    from rsmkit.optimum.problem import build_problem as build_problem
    from rsmkit.optimum.search import search_problem as search_problem
    from rsmkit.runs.record.run_table import Runs as Runs
    from rsmkit.scikit_learn import SurfaceRegressor as SurfaceRegressor
    from rsmkit.stages.evaluate import evaluate_design as evaluate_design
    from rsmkit.stages.fit import fit_study as fit_study
    from rsmkit.stages.looks.status import study_status as study_status
    from rsmkit.stages.new import create_study as create_study
    from rsmkit.stages.planning.plan import plan_design as plan_design
    from rsmkit.stages.planning.simulated_power import simulate_power as simulate_power
    from rsmkit.stages.refine import refine_study as refine_study
    from rsmkit.stages.report import write_reports as write_reports
    from rsmkit.stages.verify import verify_study as verify_study
    from rsmkit.study.file import Study as Study
    from rsmkit.study.file import load_study as load_study
    from rsmkit.study.folder import StudyFolder as StudyFolder
    from rsmkit.study.folder import open_study as open_study
    from rsmkit.surfaces.choose import choose_surface as choose_surface
    from rsmkit.surfaces.fitted_response import FittedResponse as FittedResponse
    from rsmkit.surfaces.fitted_response import surface_from_json as surface_from_json
    from rsmkit.surfaces.models.surface import Surface as Surface
    from rsmkit.surfaces.options import SurfaceOptions as SurfaceOptions
    from rsmkit.surfaces.polynomial_fit import fit_surface as fit_surface
    from rsmkit.surfaces.statistics.influence import flagged_runs as flagged_runs
    from rsmkit.surfaces.statistics.influence import without_runs as without_runs
    from rsmkit.surfaces.statistics.intervals import simultaneous_band as simultaneous_band
    from rsmkit.surfaces.statistics.intervals import tolerance_interval as tolerance_interval
    from rsmkit.surfaces.statistics.mixtures.directions import component_effects as component_effects
    from rsmkit.surfaces.statistics.mixtures.directions import trace_curves as trace_curves
    from rsmkit.surfaces.statistics.optima.canonical import canonical_analysis as canonical_analysis
    from rsmkit.surfaces.statistics.optima.canonical import stationary_region as stationary_region
    from rsmkit.surfaces.statistics.optima.ridge import ridge_path as ridge_path
    from rsmkit.surfaces.statistics.optima.ridge import steepest_path as steepest_path
    from rsmkit.surfaces.statistics.robust_estimates import robust_estimates as robust_estimates
    from rsmkit.surfaces.statistics.terms.expected_mean_squares import (
        expected_mean_squares as expected_mean_squares,
    )
    from rsmkit.surfaces.statistics.terms.mean_squares import mean_square_sum as mean_square_sum
    from rsmkit.surfaces.statistics.terms.means import contrast_of_means as contrast_of_means
    from rsmkit.surfaces.statistics.terms.means import estimated_means as estimated_means
    from rsmkit.surfaces.statistics.terms.nested_tests import extra_sum_of_squares as extra_sum_of_squares
    from rsmkit.surfaces.statistics.terms.term_tests import term_tests as term_tests
    from rsmkit.surfaces.statistics.two_level.dispersion import dispersion_effects as dispersion_effects
    from rsmkit.surfaces.statistics.two_level.lenth import screen_effects as screen_effects
    from rsmkit.surfaces.statistics.two_level.two_levels import curvature_test as curvature_test
    from rsmkit.surfaces.statistics.views import contour_grid as contour_grid
    from rsmkit.surfaces.statistics.views import perturbation_curves as perturbation_curves
    from rsmkit.surfaces.tables.coding import parse_coding as parse_coding
    from rsmkit.surfaces.tables.table_fit import fit_table as fit_table
    from rsmkit.variation.conformity.capability import capability as capability
    from rsmkit.variation.door import prove_uncertainty as prove_uncertainty
    from rsmkit.variation.door import uncertainty as uncertainty
    from rsmkit.variation.findings_of_laws import Uncertainty as Uncertainty
    from rsmkit.variation.sensitivity.morris import elementary_effects as elementary_effects
    from rsmkit.variation.sensitivity.morris import morris as morris
    from rsmkit.verification.direct_search import compare_points as compare_points
    from rsmkit.verification.direct_search import search_directly as search_directly
    from rsmkit.verification.judge import judge_optimum as judge_optimum
    from rsmkit.verification.options import RefineOptions as RefineOptions
    from rsmkit.verification.options import VerifyOptions as VerifyOptions
    from rsmkit.verification.refinement.waves import refine_problem as refine_problem
    from rsmkit.verification.verification import Confirmation as Confirmation
    from rsmkit.verification.verification import Verification as Verification

HOMES = {
    "Confirmation": "rsmkit.verification.verification",
    "Design": "rsmkit.design.design",
    "Desire": "rsmkit.optimum.desirability",
    "Equality": "rsmkit.language.equalities",
    "Factor": "rsmkit.language.space",
    "FitError": "rsmkit.errors",
    "FittedResponse": "rsmkit.surfaces.fitted_response",
    "Mixture": "rsmkit.language.equalities",
    "Optimum": "rsmkit.optimum.optimum",
    "Problem": "rsmkit.optimum.problem",
    "Quality": "rsmkit.design.quality.assessment",
    "RefineOptions": "rsmkit.verification.options",
    "RsmkitError": "rsmkit.errors",
    "Runs": "rsmkit.runs.record.run_table",
    "RunsFailedError": "rsmkit.errors",
    "SearchOptions": "rsmkit.optimum.options",
    "Space": "rsmkit.language.space",
    "StageError": "rsmkit.errors",
    "Study": "rsmkit.study.file",
    "StudyError": "rsmkit.errors",
    "StudyFolder": "rsmkit.study.folder",
    "Surface": "rsmkit.surfaces.models.surface",
    "SurfaceOptions": "rsmkit.surfaces.options",
    "SurfaceRegressor": "rsmkit.scikit_learn",
    "Terms": "rsmkit.language.terms",
    "Uncertainty": "rsmkit.variation.findings_of_laws",
    "Verification": "rsmkit.verification.verification",
    "VerifyOptions": "rsmkit.verification.options",
    "alias_matrix": "rsmkit.design.quality.aliasing",
    "allocate_runs": "rsmkit.design.quality.allocation",
    "assess": "rsmkit.design.quality.assessment",
    "augment": "rsmkit.design.optimal.optimal_design",
    "ball": "rsmkit.design.region",
    "box": "rsmkit.design.region",
    "box_behnken": "rsmkit.design.families.box_behnken",
    "build_problem": "rsmkit.optimum.problem",
    "candidate_list": "rsmkit.design.region",
    "canonical_analysis": "rsmkit.surfaces.statistics.optima.canonical",
    "capability": "rsmkit.variation.conformity.capability",
    "ccd": "rsmkit.design.families.composite",
    "choose_surface": "rsmkit.surfaces.choose",
    "compare_designs": "rsmkit.design.quality.design_comparison",
    "compare_points": "rsmkit.verification.direct_search",
    "confounded_effects": "rsmkit.design.families.two_level.factorial_blocks",
    "component_relation": "rsmkit.design.families.three_level",
    "component_effects": "rsmkit.surfaces.statistics.mixtures.directions",
    "contour_grid": "rsmkit.surfaces.statistics.views",
    "contrast_of_means": "rsmkit.surfaces.statistics.terms.means",
    "create_study": "rsmkit.stages.new",
    "curvature_test": "rsmkit.surfaces.statistics.two_level.two_levels",
    "definitive_screening": "rsmkit.design.families.two_level.screening",
    "design_space_fraction": "rsmkit.design.quality.variance",
    "design_structure": "rsmkit.design.quality.structure",
    "desirability": "rsmkit.optimum.desirability",
    "estimated_means": "rsmkit.surfaces.statistics.terms.means",
    "elementary_effects": "rsmkit.variation.sensitivity.morris",
    "dispersion_effects": "rsmkit.surfaces.statistics.two_level.dispersion",
    "evaluate": "rsmkit.api",
    "evaluate_design": "rsmkit.stages.evaluate",
    "expected_mean_squares": "rsmkit.surfaces.statistics.terms.expected_mean_squares",
    "explorer": "rsmkit.api",
    "extra_sum_of_squares": "rsmkit.surfaces.statistics.terms.nested_tests",
    "extreme_vertices": "rsmkit.design.families.mixtures.blend_designs",
    "fill": "rsmkit.design.families.space_filling",
    "fit": "rsmkit.api",
    "fit_study": "rsmkit.stages.fit",
    "fit_surface": "rsmkit.surfaces.polynomial_fit",
    "fit_table": "rsmkit.surfaces.tables.table_fit",
    "flagged_runs": "rsmkit.surfaces.statistics.influence",
    "fractional_factorial": "rsmkit.design.families.two_level.factorial",
    "full_factorial": "rsmkit.design.families.two_level.factorial",
    "full_terms": "rsmkit.language.terms",
    "halton": "rsmkit.design.families.space_filling",
    "hypervolume": "rsmkit.optimum.pareto_front",
    "in_blocks": "rsmkit.design.families.two_level.factorial_blocks",
    "information_matrix": "rsmkit.design.quality.information",
    "interaction_components": "rsmkit.design.families.three_level",
    "judge_optimum": "rsmkit.verification.judge",
    "latin_hypercube": "rsmkit.design.families.space_filling",
    "load_study": "rsmkit.study.file",
    "mean_square_sum": "rsmkit.surfaces.statistics.terms.mean_squares",
    "morris": "rsmkit.variation.sensitivity.morris",
    "nondominated": "rsmkit.optimum.pareto_front",
    "open_study": "rsmkit.study.folder",
    "optimal_design": "rsmkit.design.optimal.optimal_design",
    "split_plot_design": "rsmkit.design.optimal.split_plot",
    "parse_coding": "rsmkit.surfaces.tables.coding",
    "parse_constraint": "rsmkit.language.conditions",
    "parse_equality": "rsmkit.language.conditions",
    "parse_expression": "rsmkit.language.expression",
    "parse_terms": "rsmkit.language.terms",
    "perturbation_curves": "rsmkit.surfaces.statistics.views",
    "plackett_burman": "rsmkit.design.families.two_level.screening",
    "plan_design": "rsmkit.stages.planning.plan",
    "simulate_power": "rsmkit.stages.planning.simulated_power",
    "power_of_terms": "rsmkit.design.quality.power",
    "prove_uncertainty": "rsmkit.variation.door",
    "refine": "rsmkit.api",
    "refine_problem": "rsmkit.verification.refinement.waves",
    "refine_study": "rsmkit.stages.refine",
    "ridge_path": "rsmkit.surfaces.statistics.optima.ridge",
    "robust_estimates": "rsmkit.surfaces.statistics.robust_estimates",
    "run_order_trends": "rsmkit.design.quality.time_trends",
    "scheffe_terms": "rsmkit.language.scheffe",
    "screen_effects": "rsmkit.surfaces.statistics.two_level.lenth",
    "screening_power": "rsmkit.design.quality.screening_power",
    "search": "rsmkit.api",
    "search_directly": "rsmkit.verification.direct_search",
    "search_problem": "rsmkit.optimum.search",
    "simultaneous_band": "rsmkit.surfaces.statistics.intervals",
    "simplex_centroid": "rsmkit.design.families.mixtures.blend_designs",
    "simplex_lattice": "rsmkit.design.families.mixtures.blend_designs",
    "sobol": "rsmkit.design.families.space_filling",
    "space_terms": "rsmkit.language.space_terms",
    "standard_blocks": "rsmkit.design.families.two_level.factorial_blocks",
    "stationary_region": "rsmkit.surfaces.statistics.optima.canonical",
    "steepest_path": "rsmkit.surfaces.statistics.optima.ridge",
    "study_status": "rsmkit.stages.looks.status",
    "surface_from_json": "rsmkit.surfaces.fitted_response",
    "term_correlations": "rsmkit.design.quality.aliasing",
    "term_tests": "rsmkit.surfaces.statistics.terms.term_tests",
    "three_level_blocks": "rsmkit.design.families.three_level",
    "three_level_fraction": "rsmkit.design.families.three_level",
    "tolerance_interval": "rsmkit.surfaces.statistics.intervals",
    "trace_curves": "rsmkit.surfaces.statistics.mixtures.directions",
    "uncertainty": "rsmkit.variation.door",
    "variance_profile": "rsmkit.design.quality.variance",
    "verify": "rsmkit.api",
    "verify_study": "rsmkit.stages.verify",
    "without_runs": "rsmkit.surfaces.statistics.influence",
    "write_reports": "rsmkit.stages.report",
}
"""Every public name and the module it comes from; imported on first use."""

MODULES = ("plots", "testing")
"""Public modules, imported on first use too."""

__all__ = [*HOMES, *MODULES]


def __getattr__(name: str) -> Any:
    if name in MODULES:
        return import_module(f"{__name__}.{name}")
    if name not in HOMES:
        raise AttributeError(_unknown(name))
    return getattr(import_module(HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *HOMES, *MODULES})


def _unknown(name: str) -> str:
    from difflib import get_close_matches

    close = get_close_matches(name, HOMES, n=1)
    return f"module '{__name__}' has no attribute {name!r}" + (f"; did you mean {close[0]}?" if close else "")
