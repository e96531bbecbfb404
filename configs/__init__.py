"""Everything that ships as YAML: scenarios, studies, suites, and settings of the agents."""
