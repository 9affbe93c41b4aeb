"""One robot's controller again, on its recorded inputs."""
