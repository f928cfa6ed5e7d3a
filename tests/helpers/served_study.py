"""A study with laws of service."""

BEAM = """
[simulator]
run = "rsmkit.example.simulator:cantilever"
[simulator.settings]
length_m = 1.5
load_N = 4000.0
[factors]
width_mm = { low = 30.0, high = 60.0 }
height_mm = { low = 90.0, high = 120.0 }
[responses]
mass_kg = {}
sag_mm = {}
"""
"""The beam of the example, without a search."""

STUDY = (
    BEAM
    + """
[[search]]
name = "lightest"
minimize = "mass_kg"
subject_to = ["sag_mm <= 9"]
preset = "fast"
[uncertainty]
width_mm = { law = "normal", sd = 0.2 }
height_mm = { law = "uniform", half_width = 0.5 }
load_N = { law = "normal", sd_pct = 2 }
[specifications]
sag_mm = { high = 10 }
mass_kg = { low = 30, high = 35.2 }
[propagation]
draws = 60
samples = 256
"""
)
