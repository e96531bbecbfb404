"""Everything that ships as YAML: scenarios, tracks, studies, suites, and settings of the agents."""
