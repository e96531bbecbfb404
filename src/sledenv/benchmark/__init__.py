"""The benchmark: problems, the best launch of each context, agents trained and judged, scores and their report."""
