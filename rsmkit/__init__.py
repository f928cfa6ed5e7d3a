"""rsmkit: response surfaces and designed experiments for expensive simulators.

Plan about fifty runs, fit second-order surfaces, find the optimum on them for free, and prove it on the real
simulation.
"""

__version__ = "0.1.0"
