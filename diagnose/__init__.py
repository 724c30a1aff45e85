"""Wear estimate: grades, training, novelty, evaluation, report, command line."""
