"""Pictures: chains, stable sets, runs."""
