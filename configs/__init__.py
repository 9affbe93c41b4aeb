"""What a run is: scenarios, topologies, briefs."""
