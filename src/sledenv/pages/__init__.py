"""Descents as HTML pages, in words, as tables and as JSON; imports plot/ for shapes, simulation/ and machine/."""
