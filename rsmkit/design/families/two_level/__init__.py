"""Factorial and screening designs, and the orthogonal matrices behind them."""
