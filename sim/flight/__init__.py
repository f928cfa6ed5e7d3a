"""Flight: dynamics over the Earth, integration, history."""
