"""Coefficients of one vehicle, tabulated as they are flown."""
