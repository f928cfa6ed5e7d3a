"""Statistics of each kind of surface as JSON values, as text, and as tables for notebooks."""
