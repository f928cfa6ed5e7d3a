"""Response surfaces fitted to finished runs, and every statistic about them (``model.json``)."""
