"""The smallest study file: two factors, one response, of a simulator ``s:f`` that a test writes beside it."""

SMALLEST = """
[simulator]
run = "s:f"
[factors]
a = {low = 0.0, high = 1.0}
b = {low = 0.0, high = 1.0}
[responses]
y = {}
"""
