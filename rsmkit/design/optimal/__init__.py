"""Optimal designs: criteria, searches, and how close to the best they come."""
