"""How ``published_catalogue.py`` puts the questions of process-improve's reference catalogue to rsmkit."""
