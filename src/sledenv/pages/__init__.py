"""Descents as HTML pages, in words and as JSON; imports plot/ for shapes, and simulation/."""
