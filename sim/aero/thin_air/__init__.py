"""Free-molecular flow, and the bridge to it."""
