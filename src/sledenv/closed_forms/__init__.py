"""Closed forms: impacts of a wheel, where a body rests, tips and swings; imports simulation/."""
