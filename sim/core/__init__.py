"""What everything rests on: compiled code, errors, checks, quadrature."""
