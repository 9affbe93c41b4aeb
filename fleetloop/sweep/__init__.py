"""`fleetloop sweep`: one scenario in thousands of cases, their results in one dataset."""
