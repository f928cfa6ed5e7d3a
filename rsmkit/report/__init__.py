"""Looking at a study: static figures and the interactive explorer page (``explorer.html``)."""
