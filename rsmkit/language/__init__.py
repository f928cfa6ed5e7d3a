"""The words of the field: factors and their space, model terms, expressions."""
