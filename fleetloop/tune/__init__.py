"""`fleetloop tune`: gains that suit many cases, searched for by Optuna."""
