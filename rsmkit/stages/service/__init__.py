"""The factors as they vary in service: screening, propagation, proof."""
