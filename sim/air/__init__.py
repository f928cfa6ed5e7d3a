"""The air: standard and measured atmospheres, winds, dispersions."""
