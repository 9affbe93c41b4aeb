"""The row of a controller with the paper's law."""

from agents.laws.adaptive_dsc import AdaptiveDsc
from bridge.network.telemetry import row_of
from configs.signals import controller_signals

SIGNALS = controller_signals(AdaptiveDsc.SIGNALS)
COLUMNS = [signal.name for signal in SIGNALS]
ROW = row_of(SIGNALS)
