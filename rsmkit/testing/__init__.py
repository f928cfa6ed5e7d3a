"""Contracts that other people's simulators and kinds can be held to, in their own tests."""

from rsmkit.testing.backend_contract import check_backend
from rsmkit.testing.design_contract import check_design_family
from rsmkit.testing.factor_contract import check_factor_kind
from rsmkit.testing.report_contract import check_report_writer
from rsmkit.testing.simulator_contract import check_simulator
from rsmkit.testing.surface_contract import check_surface_kind

__all__ = [
    "check_backend",
    "check_design_family",
    "check_factor_kind",
    "check_report_writer",
    "check_simulator",
    "check_surface_kind",
]
