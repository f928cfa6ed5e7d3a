"""What is asked of models of mixtures alone: effects of components, their order, where they lead."""
