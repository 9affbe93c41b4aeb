"""Control laws, one file each; their interface is `agents.laws.interface`."""
