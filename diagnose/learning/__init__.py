"""Learning without recordings: grades, regressions, conformal intervals, scores.

It may import nothing of the house.
"""
