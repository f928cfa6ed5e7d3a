"""What two-level experiments are asked: few runs, curvature, dispersion."""
