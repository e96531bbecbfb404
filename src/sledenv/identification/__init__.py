"""From recordings to a contact law: what is fitted to measured rebounds and tracks, and how sure one may be of it."""
