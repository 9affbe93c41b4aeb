"""`fleetloop sweep report`: a study's dataset as a page, figures and tables."""
