"""Bodies, laws, slopes, launches and settings, checked; descents, rides, impacts, derivatives; imports kernel/."""
